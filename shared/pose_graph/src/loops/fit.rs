//! One picture of a place laid onto another: point to plane, robust.

use super::keyframe::SurfacePoint;
use crate::tangent::moved;
use geometry::Pose;
use nalgebra::{Matrix6, Vector6};
use registration::{Kernel, LocalMap, MapPoint, Weights};

/// Reach and robust scale of each round, m: as far as a map can look, then as near as its spacing allows.
const ROUNDS: [(f64, f64); 24] = {
    let mut rounds = [(0.5, 0.05); 24];
    let mut k = 0;
    while k < 8 {
        rounds[k] = (0.5, 0.3);
        k += 1;
    }
    rounds
};
/// Fewer matches are no measurement.
const MIN_MATCHES: usize = 300;
/// Error of a residual, m: matches at one wall err alike, so it is larger than the noise.
const RESIDUAL_M: f64 = 0.2;
/// What no number of matches takes away, m and rad: how well two looks at a town from two places agree.
const FLOOR_M: f64 = 0.03;
const FLOOR_RAD: f64 = 0.001;

/// A fit.
#[derive(Clone, Debug)]
pub struct Fit {
    pub target_from_source: Pose,
    /// Share of the source's points with a surface of the target in reach.
    pub matched: f64,
    /// Weighted root mean square distance, m.
    pub rms_m: f64,
    /// Inverse covariance: translation in the target's axes, rotation in the source's.
    pub information: Matrix6<f64>,
}

/// The surfaces of a keyframe, to be found by place.
pub fn map_of(surfaces: &[SurfacePoint]) -> LocalMap {
    let point = |surface: &SurfacePoint| MapPoint {
        position: surface.position.coords.into(),
        normal: surface.normal.cast::<f32>().into(),
        batch: 0,
    };
    LocalMap::from_points(&surfaces.iter().map(point).collect::<Vec<_>>())
}

/// From a guess within half a metre. `None` if too little is in reach.
pub fn fit(target: &LocalMap, source: &[SurfacePoint], guess: &Pose) -> Option<Fit> {
    let mut target_from_source = *guess;
    let mut last = None;
    for (radius_m, scale_m) in ROUNDS {
        let kernel = Kernel { radius_m, weights: Weights::Compact };
        let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
        let (mut weight_sum, mut squares, mut n) = (0.0, 0.0, 0);
        for point in source {
            let position = target_from_source * point.position;
            let normal = target_from_source.rotation * point.normal;
            let Some(surface) = target.surface(position.coords.into(), &normal.cast(), &kernel) else { continue };
            let r = surface.distance_m;
            let weight = 1.0 / (1.0 + (r / scale_m).powi(2));
            // Along the axes of the source: a motion (v, w) shifts the point by R (v + w x p).
            let normal_in_source = target_from_source.rotation.inverse() * surface.normal;
            let turn = point.position.coords.cross(&normal_in_source);
            let n_in = normal_in_source;
            let j = Vector6::new(n_in.x, n_in.y, n_in.z, turn.x, turn.y, turn.z);
            h += j * j.transpose() * weight;
            g += j * (r * weight);
            weight_sum += weight;
            squares += weight * r * r;
            n += 1;
        }
        if n < MIN_MATCHES {
            return None;
        }
        // What nothing determines (along a tunnel) stays where it is.
        let step = (h + Matrix6::identity() * (1e-3 * weight_sum)).cholesky()?.solve(&-g);
        target_from_source = moved(&target_from_source, &step);
        last = Some((h, squares / weight_sum, n));
    }
    let (h, mean_square, n) = last?;
    Some(Fit {
        information: information(&h, &target_from_source)?,
        target_from_source,
        matched: f64::from(n as u32) / source.len() as f64,
        rms_m: mean_square.sqrt(),
    })
}

fn information(h: &Matrix6<f64>, target_from_source: &Pose) -> Option<Matrix6<f64>> {
    // Something tiny keeps a direction without any match finite: a kilometre, a radian.
    let loose = Vector6::new(1e-6, 1e-6, 1e-6, 1.0, 1.0, 1.0);
    let covariance = (h / (RESIDUAL_M * RESIDUAL_M) + Matrix6::from_diagonal(&loose)).try_inverse()?;
    let (m, rad) = (FLOOR_M * FLOOR_M, FLOOR_RAD * FLOOR_RAD);
    let covariance = covariance + Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
    // Steps were along the source's axes; the graph wants the target's for translations.
    let mut axes = Matrix6::identity();
    axes.fixed_view_mut::<3, 3>(0, 0).copy_from(target_from_source.rotation.to_rotation_matrix().matrix());
    let information = (axes * covariance * axes.transpose()).try_inverse()?;
    // Rounding leaves it a little skew.
    Some((information + information.transpose()) * 0.5)
}
