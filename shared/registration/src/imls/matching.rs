//! Matching: samples are projected to the surface of the model, then the pose is estimated point to plane (III-D).

use super::ImlsSettings;
use super::model::Model;
use crate::matching::normal_equations::{NUISANCES, NormalEquations, NuisancePrior, StepPrior};
use crate::{Feature, Matched, SweepMotion};
use geometry::{Isometry3, Pose, Translation3, UnitQuaternion, Vector3};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// Fewer samples near the model do not constrain six unknowns. The paper has no limit.
const MIN_MATCHES: usize = 60;
/// Samples of one parallel task; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 32;
/// Rotations are converted to the displacement at this distance, m, in the report on degenerate directions.
const LEVER_M: f64 = 10.0;
/// A match has converged if the translation and rotation of its last step are below these.
const CONVERGED_M: f64 = 0.05;
const CONVERGED_RAD: f64 = 5e-3;

/// Inputs of the report in addition to the paper's constants; see [`crate::MatchSettings`].
pub(super) struct Reported {
    pub min_influence: f64,
    pub drift_residual_m: f64,
}

/// Matches samples in the LiDAR frame at the last shot. Returns the pose at the last shot; `Matched::motion` is at rest
/// there. Returns `None` if too few samples are near the model or the equations are singular.
pub(super) fn match_samples(
    samples: &[Feature],
    model: &Model,
    predicted: &Pose,
    settings: &ImlsSettings,
    reported: &Reported,
) -> Option<Matched> {
    let mut pose = *predicted;
    let mut last = None;
    for _ in 0..settings.rounds {
        let equations = linearize(samples, model, &pose, settings);
        if equations.n_matches < MIN_MATCHES {
            return None;
        }
        // The paper has neither a prior nor nuisance parameters: both stay at zero.
        let no_prior = StepPrior { information: &Matrix6::zeros(), step: &Vector6::zeros() };
        let at_zero = NuisancePrior { information: 1.0, expected: 0.0 };
        let step = equations.solve(&no_prior, None, [at_zero; NUISANCES])?.pose;
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
        let mut rotation = turn * pose.rotation;
        // Products of unit quaternions drift from unit length.
        rotation.renormalize();
        let translation = pose.translation.vector + step.fixed_rows::<3>(0);
        pose = Isometry3::from_parts(Translation3::from(translation), rotation);
        last = Some((equations, step));
    }
    let (equations, step) = last?;
    let mean_square = equations.weighted_squares / equations.weight;
    let influences = influences(&equations);
    let is_degenerate = |influence: &&f64| **influence < reported.min_influence;
    Some(Matched {
        motion: SweepMotion::still(pose),
        n_features: samples.len(),
        n_matches: equations.n_matches,
        rms_m: mean_square.sqrt(),
        cost: equations.cost / samples.len() as f64,
        least_influence: influences.min(),
        n_degenerate_directions: influences.iter().filter(is_degenerate).count() as u32,
        information: equations.pose() / mean_square.max(1e-6),
        step_information: equations.pose() / reported.drift_residual_m.powi(2),
        converged: step.fixed_rows::<3>(0).norm() < CONVERGED_M && step.fixed_rows::<3>(3).norm() < CONVERGED_RAD,
    })
}

fn linearize(samples: &[Feature], model: &Model, pose: &Pose, settings: &ImlsSettings) -> NormalEquations {
    let part = |chunk: &[Feature]| {
        let mut sum = NormalEquations::zero();
        for sample in chunk {
            let arm = pose.rotation * Vector3::from(sample.position).cast::<f64>();
            let Some(surface) = model.surface(&(arm + pose.translation.vector), settings) else {
                sum.cost += 1.0;
                continue;
            };
            sum.cost += (surface.distance_m / settings.radius_m).powi(2).min(1.0);
            sum.add(&arm, &surface.normal, surface.distance_m, [0.0; NUISANCES], 1.0, 0.0);
        }
        sum
    };
    let parts: Vec<NormalEquations> = samples.par_chunks(CHUNK).map(part).collect();
    let mut sum = NormalEquations::zero();
    for part in &parts {
        sum.merge(part);
    }
    sum
}

/// Mean squared influence of the principal directions of the pose on the residuals.
fn influences(equations: &NormalEquations) -> Vector6<f64> {
    let inverse_lever = Vector6::new(1.0, 1.0, 1.0, 1.0 / LEVER_M, 1.0 / LEVER_M, 1.0 / LEVER_M);
    let scale = Matrix6::from_diagonal(&inverse_lever);
    (scale * equations.pose() * scale / equations.weight).symmetric_eigenvalues().map(|value| value.max(0.0))
}
