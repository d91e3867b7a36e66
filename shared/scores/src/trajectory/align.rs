//! Alignment of the estimate to the truth (Umeyama, PAMI 1991).

use super::pose_pair::PosePair;
use geometry::{Isometry3, Translation3, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Rotation3};

/// Transform that is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// No transform: both trajectories are in the same world frame.
    None,
    /// The first poses become equal.
    First,
    /// Rotation and translation, by least squares of the position errors.
    Se3,
    /// Rotation, translation and scale, by least squares of the position errors.
    Sim3,
}

/// `truth_world_from_estimate_world`: scale, then rotation, then translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Scale; 1 unless the alignment is [`Alignment::Sim3`].
    pub scale: f64,
    /// Pose applied after the scale.
    pub pose: Isometry3<f64>,
}

/// Reason why poses cannot be aligned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AlignError {
    /// There are no poses.
    #[error("there are no poses to align")]
    NoPoses,
    /// All positions are equal or on one line, so that a rotation about the line is undetermined.
    #[error("all positions are on one line or equal, so the rotation is undetermined; align by the first pose instead")]
    OnALine,
}

impl Similarity {
    fn identity() -> Self {
        Self { scale: 1.0, pose: Isometry3::identity() }
    }

    /// Transforms the estimated poses.
    pub fn apply(&self, pairs: &mut [PosePair]) {
        for pair in pairs {
            pair.estimate.translation.vector *= self.scale;
            pair.estimate = self.pose * pair.estimate;
        }
    }
}

/// The transform from the world of the estimate to the world of the truth.
pub fn align(pairs: &[PosePair], alignment: Alignment) -> Result<Similarity, AlignError> {
    let first = pairs.first().ok_or(AlignError::NoPoses)?;
    match alignment {
        Alignment::None => Ok(Similarity::identity()),
        Alignment::First => Ok(Similarity { scale: 1.0, pose: first.truth * first.estimate.inverse() }),
        Alignment::Se3 => umeyama(pairs, false),
        Alignment::Sim3 => umeyama(pairs, true),
    }
}

fn umeyama(pairs: &[PosePair], with_scale: bool) -> Result<Similarity, AlignError> {
    let n = pairs.len() as f64;
    let mean = |position: fn(&PosePair) -> Vector3<f64>| pairs.iter().map(position).sum::<Vector3<f64>>() / n;
    let truth = mean(|pair| pair.truth.translation.vector);
    let estimate = mean(|pair| pair.estimate.translation.vector);
    let mut covariance = Matrix3::zeros();
    let mut variance = 0.0;
    for pair in pairs {
        let y = pair.truth.translation.vector - truth;
        let x = pair.estimate.translation.vector - estimate;
        covariance += y * x.transpose() / n;
        variance += x.norm_squared() / n;
    }
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Err(AlignError::OnALine) };
    // Sorted, largest first. Rounding errors are about 1e-16 of the largest.
    if svd.singular_values[1] <= 1e-12 * svd.singular_values[0] {
        return Err(AlignError::OnALine);
    }
    let mut signs = Vector3::repeat(1.0);
    if u.determinant() * v_t.determinant() < 0.0 {
        signs[2] = -1.0;
    }
    let rotation = u * Matrix3::from_diagonal(&signs) * v_t;
    let scale = if with_scale { svd.singular_values.dot(&signs) / variance } else { 1.0 };
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let translation = Translation3::from(truth - scale * (rotation * estimate));
    Ok(Similarity { scale, pose: Isometry3::from_parts(translation, rotation) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::position_errors;
    use geometry::{Pose, Stamp};

    fn spiral(moved: &Pose, scale: f64) -> Vec<PosePair> {
        let pair = |i: i64| {
            let s = i as f64 * 0.1;
            let truth = Pose::new(Vector3::new(s.cos() * s, s.sin() * s, 0.2 * s), Vector3::z() * s);
            let mut estimate = moved.inverse() * truth;
            estimate.translation.vector /= scale;
            PosePair { stamp: Stamp(i), truth, estimate }
        };
        (0..100).map(pair).collect()
    }

    #[test]
    fn transformed_estimate_is_transformed_back() {
        let moved = Pose::new(Vector3::new(100.0, -40.0, 7.0), Vector3::new(0.3, -0.2, 2.5));
        for (alignment, scale) in [(Alignment::First, 1.0), (Alignment::Se3, 1.0), (Alignment::Sim3, 1.25)] {
            let mut pairs = spiral(&moved, scale);
            assert!(position_errors(&pairs)[50] > 10.0);
            let found = align(&pairs, alignment).expect("aligns");
            assert!((found.scale - scale).abs() < 1e-12);
            found.apply(&mut pairs);
            let errors = position_errors(&pairs);
            assert!(errors.len() == 100 && errors.iter().all(|error| *error < 1e-10), "{alignment:?}");
            assert!(pairs.iter().all(|pair| pair.truth.rotation.angle_to(&pair.estimate.rotation) < 1e-7));
        }
    }

    #[test]
    fn undetermined_alignment_is_refused() {
        assert_eq!(align(&[], Alignment::None), Err(AlignError::NoPoses));
        let mut straight = spiral(&Pose::identity(), 1.0);
        for pair in &mut straight {
            pair.truth.translation.vector = Vector3::new(1.0, 2.0, 3.0) * pair.stamp.0 as f64;
            pair.estimate.translation.vector = pair.truth.translation.vector;
        }
        assert_eq!(align(&straight, Alignment::Se3), Err(AlignError::OnALine));
        let found = align(&straight, Alignment::First).expect("a pose is enough");
        assert_eq!(found.scale, 1.0);
    }
}
