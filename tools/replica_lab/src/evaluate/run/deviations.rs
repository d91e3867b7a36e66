//! Comparison of the standard deviations that a run states for its submaps with their real errors.

use super::place::RunPlace;
use super::pose_error::PoseError;
use anyhow::Context;
use delivery::CloudEntry;
use drive::manifest::PoseEntry;
use geometry::{Pose, Stamp, Trajectory, heading};
use messages::{PlacementRow, PoseDeviation};

/// 0.3 % of normal errors with a correctly stated deviation lie beyond three standard deviations.
const BEYOND: f64 = 3.0;

/// Real errors and stated deviations of all submaps.
pub struct SubmapErrors {
    /// Whether the errors are in the world, or relative to the first submap.
    pub is_in_world: bool,
    /// Submaps with a true pose and stated deviations.
    pub n_submaps: usize,
    /// Submaps without a true pose.
    pub n_without_truth: usize,
    /// All quantities.
    pub quantities: [Quantity; 3],
}

/// A compared quantity.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    pub name: &'static str,
    pub unit: &'static str,
    pub comparison: Comparison,
}

/// An error with its stated deviation.
#[derive(Clone, Copy)]
struct StatedError {
    real: f64,
    stated: f64,
}

/// Real errors of one quantity against the stated deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Submaps with a deviation above 0.
    pub n: usize,
    /// Root mean square of the real errors.
    pub real_rms: f64,
    /// Largest real error.
    pub real_max: f64,
    /// Root mean square of the stated deviations.
    pub stated_rms: f64,
    /// Root mean square of error divided by deviation: 1 is consistent, below 1 pessimistic, above 1 overconfident.
    pub ratio_rms: f64,
    /// Largest error divided by its deviation.
    pub ratio_max: f64,
    /// Errors beyond three deviations.
    pub n_beyond: usize,
}

impl SubmapErrors {
    /// `None` if no submap states deviations or has a true pose.
    pub fn from_clouds(truth: &Trajectory, place: &RunPlace, clouds: &[CloudEntry]) -> anyhow::Result<Option<Self>> {
        let mut n_without_truth = 0;
        let mut submaps: Vec<(Pose, Pose, PoseDeviation)> = Vec::new();
        for cloud in clouds {
            let Some(sigma_m) = cloud.sigma_m else { continue };
            let Some(sigma_rad) = cloud.sigma_rad else { continue };
            let Some(world_from_body) = truth.at(Stamp(cloud.stamp_begin)) else {
                n_without_truth += 1;
                continue;
            };
            // A submap has the position and the heading of the body at its first shot.
            let true_pose = Pose::from_parts(world_from_body.translation, heading(&world_from_body.rotation));
            let entry = PoseEntry { translation: cloud.translation, rotation: cloud.rotation };
            let pose = entry
                .to_pose()
                .with_context(|| format!("pose of submap {}: {entry:?} is not a rigid transform", cloud.seq))?;
            let deviation = PlacementRow { sigma_m, sigma_rad, ..PlacementRow::default() }.deviation();
            submaps.push((true_pose, pose, deviation));
        }
        let Some((first_true, first, _)) = submaps.first().copied() else { return Ok(None) };
        let (truth_from_run, is_in_world) = match place {
            RunPlace::World { truth_from_run } => (*truth_from_run, true),
            RunPlace::Own(_) | RunPlace::Odometry => (first_true * first.inverse(), false),
        };
        let errors: Vec<(PoseError, PoseDeviation)> = submaps
            .iter()
            .map(|(truth, pose, deviation)| (PoseError::between(truth, &(truth_from_run * pose)), *deviation))
            .collect();
        let compare = |name, unit, real: fn(&PoseError) -> f64, stated: fn(&PoseDeviation) -> f64| {
            let pairs =
                errors.iter().map(|(error, deviation)| StatedError { real: real(error), stated: stated(deviation) });
            Quantity { name, unit, comparison: Comparison::from_pairs(pairs) }
        };
        Ok(Some(Self {
            is_in_world,
            n_submaps: submaps.len(),
            n_without_truth,
            quantities: [
                compare("horizontal position", "m", |error| error.horizontal_m, |stated| stated.position_m),
                compare("height", "m", |error| error.height_m, |stated| stated.height_m),
                compare("heading", "deg", |error| error.heading_deg, |stated| stated.heading_deg),
            ],
        }))
    }

    /// Whether no error lies beyond three of its deviations.
    pub fn is_honest(&self) -> bool {
        self.quantities.iter().all(|quantity| quantity.comparison.n_beyond == 0)
    }
}

impl Comparison {
    /// Comparison of pairs of an error and its deviation. The submap that defines the frame has the deviation 0 and is left out.
    fn from_pairs(pairs: impl Iterator<Item = StatedError>) -> Self {
        let pairs: Vec<StatedError> = pairs.filter(|pair| pair.stated > 0.0 && pair.stated.is_finite()).collect();
        let rms = |value: fn(&StatedError) -> f64| {
            let sum: f64 = pairs.iter().map(|pair| value(pair).powi(2)).sum();
            (sum / pairs.len().max(1) as f64).sqrt()
        };
        let max = |value: fn(&StatedError) -> f64| pairs.iter().map(value).fold(0.0, f64::max);
        Self {
            n: pairs.len(),
            real_rms: rms(|pair| pair.real),
            real_max: max(|pair| pair.real),
            stated_rms: rms(|pair| pair.stated),
            ratio_rms: rms(|pair| pair.real / pair.stated),
            ratio_max: max(|pair| pair.real / pair.stated),
            n_beyond: pairs.iter().filter(|pair| pair.real > BEYOND * pair.stated).count(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comparison_matches_manual_calculation() {
        let found = Comparison::from_pairs(
            [[3.0, 1.0], [8.0, 2.0], [5.0, 0.0]].map(|[real, stated]| StatedError { real, stated }).into_iter(),
        );
        assert_eq!((found.n, found.real_max, found.ratio_max, found.n_beyond), (2, 8.0, 4.0, 1));
        assert!((found.real_rms - 36.5_f64.sqrt()).abs() < 1e-12 && (found.stated_rms - 2.5_f64.sqrt()).abs() < 1e-12);
        assert!((found.ratio_rms - 12.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(Comparison::from_pairs(std::iter::empty()), Comparison::default());
    }
}
