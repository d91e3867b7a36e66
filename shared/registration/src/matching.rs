//! Scan-to-map matching: point to plane, robust, over the pose and the motion during the sweep.

use crate::local_map::{Kernel, Weights};
use crate::maps::Maps;
use crate::motion::Velocity;
use crate::normal_equations::NormalEquations;
use crate::{Feature, Sampling, SweepMotion};
use geometry::{Isometry3, Pose, Translation3, UnitQuaternion};
use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;

/// How features are matched.
#[derive(Clone, Debug, PartialEq)]
pub struct MatchSettings {
    /// Which features are matched.
    pub sampling: Sampling,
    /// How map points around a feature count.
    pub weights: Weights,
    /// Whether the motion during the sweep is found along with its pose, tied to the way from the sweep before. If not, the
    /// sweep is rigid, deskewed as predicted, and deskewed again with the way from the sweep before to the pose found
    /// (Deschaud 2018).
    pub bends: bool,
    /// Rounds with the coarse radius and scale, at most: one whose step is below the fine scale is the last of them.
    pub coarse_rounds: u32,
    /// Rounds in all, at most.
    pub max_rounds: u32,
    /// Search radius and robust scale (Cauchy; infinite = least squares) of the coarse rounds, m.
    pub coarse: (f64, f64),
    /// The same of the fine rounds, m.
    pub fine: (f64, f64),
    /// Changes of velocity to be expected, m/s^2 and rad/s^2: how firmly the motion during a sweep is tied to the
    /// motion from the sweep before.
    pub acceleration: (f64, f64),
    /// Error of a residual for the purpose of that tie, m. Larger than the range noise: neighbors err alike.
    pub residual_m: f64,
    /// Error of a residual for the purpose of the covariance, m.
    pub drift_residual_m: f64,
    /// A step below this (m, rad) ends the fine rounds.
    pub small_step: (f64, f64),
    /// A direction is weak if its mean squared influence on the residuals is below this (0 to 1; rotations at 10 m).
    pub min_influence: f64,
    /// Rough features are matched, too, where the weakest influence of the smooth ones is below this.
    pub rough_below: f64,
}

impl Default for MatchSettings {
    /// 2000 features average 3 cm of noise below 1 mm. The coarse radius is what the map's cells allow; the fine one
    /// spans 1.5 times the map's spacing, so that a surface is the mean of several points. Drift on the synthetic
    /// street of `tests/support/world.rs`: 0.29, 0.31, 0.33 % with 0.3, 0.4, 0.5 m; 0.58 % with the nearest point
    /// alone. Cauchy's 0.1 m is three times noise and roughness. 4 m/s^2 is firm braking. 0.7 rad/s^2 is a car pitching
    /// by 0.5 degrees at 1.4 Hz; a looser tie lets noise bend the sweep (same street: 0.29 % with 1.5, 0.22 % with
    /// 0.7). 0.004 is what normals that are off by 3.6 degrees pretend along a tunnel.
    fn default() -> Self {
        Self {
            sampling: Sampling::Even { spacing_m: 0.5, max_features: 2000 },
            weights: Weights::Compact,
            bends: true,
            coarse_rounds: 3,
            max_rounds: 15,
            coarse: (0.5, 0.3),
            fine: (0.3, 0.05),
            acceleration: (4.0, 0.7),
            residual_m: 0.1,
            drift_residual_m: 0.015,
            small_step: (1e-3, 1.745e-4),
            min_influence: 0.001,
            rough_below: 0.005,
        }
    }
}

/// Result of matching a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Matched {
    /// `odom_from_lidar` over the sweep.
    pub motion: SweepMotion,
    /// Features tried.
    pub n_features: usize,
    /// Features with a map point in reach.
    pub n_matches: usize,
    /// Weighted root mean square of the distances from the map's planes, m.
    pub rms_m: f64,
    /// Mean over the features of min(1, (distance / scale)^2), 1 for those without a match: 0 good, 1 bad.
    pub cost: f64,
    /// Smallest mean squared influence of any direction, see [`MatchSettings::min_influence`].
    pub weakest_influence: f64,
    /// Directions (0 to 6) that were held to the prediction.
    pub n_weak_directions: u32,
    /// Inverse covariance of the pose: translation (m), then rotation (rad), in odom axes about the lidar. Features are
    /// taken as independent.
    pub information: Matrix6<f64>,
    /// The same by [`MatchSettings::drift_residual_m`], with nothing along weak directions: what the
    /// covariance of a [`crate::Registered`] is made of.
    pub step_information: Matrix6<f64>,
    /// Whether the last step was below 5 cm and 5 mrad. Steps that go on beyond lead somewhere else, or to and fro.
    pub converged: bool,
}

/// What is known before matching.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    /// The motion over the sweep.
    pub motion: SweepMotion,
    /// The pose before and the seconds since, to which the motion during the sweep is tied.
    pub previous: (Pose, f64),
    /// Seconds from first to last shot.
    pub duration_s: f64,
    /// Inverse covariance of the pose, if more than constant motion foretells it; otherwise zero. Order and axes as
    /// [`Matched::information`].
    pub information: Matrix6<f64>,
}

/// Rotations weigh as the displacement that they cause at this distance, m: the middle of a street scene.
const LEVER_M: f64 = 10.0;
/// Fewer matches than this are no measurement of six unknowns.
const MIN_MATCHES: usize = 60;
/// A match has converged if its last step is below this, m and rad: one that still moves by more is worse than what was foretold,
/// which errs by as much.
const SETTLED: (f64, f64) = (0.05, 5e-3);
/// Features of one piece of parallel work; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 256;

/// Moves the sweep onto the map, from the prediction. `None` if too few features find the map, or nothing determines
/// the pose.
pub(crate) fn match_features(
    features: &[Feature],
    maps: &Maps,
    prediction: &Prediction,
    settings: &MatchSettings,
) -> Option<Matched> {
    let mut motion = prediction.motion;
    let mut coarse_rounds = settings.coarse_rounds;
    for round in 0..settings.max_rounds {
        let coarse = round < coarse_rounds;
        let (radius_m, scale_m) = if coarse { settings.coarse } else { settings.fine };
        let kernel = Kernel { radius_m, weights: settings.weights };
        let equations = linearize(features, maps, &motion, &kernel, scale_m);
        if equations.n_matches < MIN_MATCHES {
            return None;
        }
        let weak = WeakDirections::of(&equations, settings.min_influence);
        let (pose_step, motion_step) = solve(&equations, &weak, &motion, prediction, settings)?;
        motion = stepped(&motion, &pose_step, &motion_step);
        let (small_m, small_rad) = settings.small_step;
        let step_is_below =
            |m: f64, rad: f64| pose_step.fixed_rows::<3>(0).norm() < m && pose_step.fixed_rows::<3>(3).norm() < rad;
        let small = step_is_below(small_m, small_rad);
        if coarse && step_is_below(settings.fine.1, settings.fine.1 / LEVER_M) {
            coarse_rounds = 0;
        }
        let is_done = !coarse && small;
        if is_done || round + 1 == settings.max_rounds {
            if !settings.bends {
                let (previous, seconds) = &prediction.previous;
                motion =
                    Velocity::between(previous, &motion.mid, *seconds).motion_at(motion.mid, prediction.duration_s);
            }
            let mean_square = equations.weighted_squares / equations.weight;
            return Some(Matched {
                motion,
                n_features: features.len(),
                n_matches: equations.n_matches,
                rms_m: mean_square.sqrt(),
                cost: equations.cost / features.len() as f64,
                weakest_influence: weak.weakest,
                n_weak_directions: weak.n,
                // A floor of 1 mm keeps a perfect scene finite.
                information: equations.pose() / mean_square.max(1e-6),
                step_information: weak.others / settings.drift_residual_m.powi(2),
                converged: step_is_below(SETTLED.0, SETTLED.1),
            });
        }
    }
    None
}

fn linearize(
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    kernel: &Kernel,
    scale_m: f64,
) -> NormalEquations {
    let part = |chunk: &[Feature]| {
        wide_loops::run(
            #[inline(always)]
            || linearize_chunk(chunk, maps, motion, kernel, scale_m),
        )
    };
    let parts: Vec<NormalEquations> = features.par_chunks(CHUNK).map(part).collect();
    let mut sum = NormalEquations::zero();
    for part in &parts {
        sum.merge(part);
    }
    sum
}

#[inline(always)]
fn linearize_chunk(
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    kernel: &Kernel,
    scale_m: f64,
) -> NormalEquations {
    let mut sum = NormalEquations::zero();
    let rotation = *motion.mid.rotation.to_rotation_matrix().matrix();
    for feature in features {
        let share = f64::from(feature.share);
        let arm = motion.rotated(&rotation, &feature.position, share);
        let position = arm + motion.mid.translation.vector + motion.translation * share;
        let normal = rotation * Vector3::from(feature.normal).cast::<f64>();
        let Some(surface) = maps.of(feature).surface(position.into(), &normal.cast(), kernel) else {
            sum.cost += 1.0;
            continue;
        };
        let r = surface.distance_m;
        let squared = (r / scale_m).powi(2);
        sum.cost += squared.min(1.0);
        sum.add(&arm, &surface.normal, r, feature.weight() / (1.0 + squared), share);
    }
    sum
}

/// Directions of the pose that the scene hardly determines.
struct WeakDirections {
    /// Stiffness that holds them where they are.
    stiffness: Matrix6<f64>,
    /// What the other directions contribute to the normal equations.
    others: Matrix6<f64>,
    weakest: f64,
    n: u32,
}

impl WeakDirections {
    fn of(equations: &NormalEquations, min_influence: f64) -> Self {
        let inverse_lever = Vector6::new(1.0, 1.0, 1.0, 1.0 / LEVER_M, 1.0 / LEVER_M, 1.0 / LEVER_M);
        let scale = Matrix6::from_diagonal(&inverse_lever);
        let eigen = (scale * equations.pose() * scale / equations.weight).symmetric_eigen();
        let mut weak = Self { stiffness: Matrix6::zeros(), others: Matrix6::zeros(), weakest: f64::MAX, n: 0 };
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            weak.weakest = weak.weakest.min(value.max(0.0));
            let direction = vector.component_div(&inverse_lever);
            let square = direction * direction.transpose() * equations.weight;
            if *value < min_influence {
                weak.n += 1;
                // A hundred times what a strong direction has.
                weak.stiffness += square * 100.0;
            } else {
                weak.others += square * *value;
            }
        }
        weak
    }
}

/// Steps of pose and motion, both as translation (m) and rotation vector (rad) in odom axes.
fn solve(
    equations: &NormalEquations,
    weak: &WeakDirections,
    motion: &SweepMotion,
    prediction: &Prediction,
    settings: &MatchSettings,
) -> Option<(Vector6<f64>, Vector6<f64>)> {
    let to_predicted = step_between(&motion.mid, &prediction.motion.mid);
    let pose_prior = weak.stiffness + prediction.information * settings.residual_m.powi(2);
    if !settings.bends {
        let pose_step = equations.solve_pose((&pose_prior, &to_predicted))?;
        return Some((pose_step, Vector6::zeros()));
    }
    let (previous, seconds) = &prediction.previous;
    let tied = Velocity::between(previous, &motion.mid, *seconds).motion_at(motion.mid, prediction.duration_s);
    let rotation_gap = motion.mid.rotation * (tied.rotation - motion.rotation);
    let translation_gap = tied.translation - motion.translation;
    let mut to_tied = Vector6::zeros();
    to_tied.fixed_rows_mut::<3>(0).copy_from(&translation_gap);
    to_tied.fixed_rows_mut::<3>(3).copy_from(&rotation_gap);
    // The tie lies half the time between the poses before the middle of the sweep; see `Velocity::between`.
    let drift_s2 = prediction.duration_s.max(1e-3) * seconds / 2.0;
    let firm = |acceleration: f64| (settings.residual_m / (acceleration * drift_s2)).powi(2);
    let (a, w) = (firm(settings.acceleration.0), firm(settings.acceleration.1));
    let tie = Matrix6::from_diagonal(&Vector6::new(a, a, a, w, w, w)) + weak.stiffness;
    equations.solve((&pose_prior, &to_predicted), (&tie, &to_tied))
}

/// Translation and rotation vector (odom axes) that lead from one pose to the other.
fn step_between(from: &Pose, to: &Pose) -> Vector6<f64> {
    let mut step = Vector6::zeros();
    step.fixed_rows_mut::<3>(0).copy_from(&(to.translation.vector - from.translation.vector));
    step.fixed_rows_mut::<3>(3).copy_from(&(to.rotation * from.rotation.inverse()).scaled_axis());
    step
}

fn stepped(motion: &SweepMotion, pose_step: &Vector6<f64>, motion_step: &Vector6<f64>) -> SweepMotion {
    let turn = UnitQuaternion::from_scaled_axis(pose_step.fixed_rows::<3>(3).into_owned());
    let mut rotation = turn * motion.mid.rotation;
    // Products of unit quaternions drift off the sphere, over a drive by more than a message's check allows.
    rotation.renormalize();
    SweepMotion {
        mid: Isometry3::from_parts(
            Translation3::from(motion.mid.translation.vector + pose_step.fixed_rows::<3>(0)),
            rotation,
        ),
        translation: motion.translation + motion_step.fixed_rows::<3>(0),
        rotation: motion.rotation + motion.mid.rotation.inverse() * motion_step.fixed_rows::<3>(3).into_owned(),
    }
}
