//! Scan-to-map matching: robust point-to-plane registration over the pose of a sweep and the motion during it
//! (IMLS-SLAM, III-D, with an estimated instead of a predicted motion during the sweep).
//!
//! Unknowns: pose T (`odom_from_lidar` in the middle of the sweep), motion m during the sweep, and three nuisance
//! parameters of the sensor. A feature at share s of the sweep has position p; the nearest surface of the map has a
//! point q and a normal n.
//!
//! 1. Residual: r = n · (T(s, m) p − q) − l · b, with the nuisance parameters b (ground tilt, common elevation error of
//!    all rings, displacement during the revolution of a sensor without point times) and their levers l.
//! 2. Cost: Σ w ρ(r / σ), with the Cauchy kernel as iterated weights w / (1 + (r / σ)²).
//! 3. Normal equations: H = Σ w J Jᵀ, g = Σ w J r, with J = (n, arm × n) for the pose.
//! 4. Degenerate directions: eigenvectors of S H S / Σ w, S = 1 for translations and 1 / 10 m for rotations, whose
//!    eigenvalue is below `min_influence`. Added information keeps them at the prediction.
//! 5. Prior of the pose: the information of the prediction, if sensors predicted it. Prior of the motion: the motion
//!    from the previous pose to T, with the velocity changes that a vehicle can reach.

pub(crate) mod normal_equations;
pub(crate) mod rough_overlap;

use crate::map::maps::Maps;
use crate::motion::Velocity;
use crate::self_calibration::ground_tilt::{GroundLever, GroundTilt};
use crate::self_calibration::ring_errors::{RingError, RingSums};
use crate::self_calibration::spin_direction::{TurnLever, TurnShare};
use crate::{Feature, Kernel, Sampling, SweepMotion, Weights};
use geometry::{Isometry3, Pose, Translation3, UnitQuaternion};
use nalgebra::{Matrix6, Vector3, Vector6};
use normal_equations::{NormalEquations, NuisancePrior, Solution, StepPrior};
use rayon::prelude::*;

/// Settings of the matching.
#[derive(Clone, Debug, PartialEq)]
pub struct MatchSettings {
    /// Sampling of the features to match.
    pub sampling: Sampling,
    /// Weights of the map points around a feature.
    pub weights: Weights,
    /// Whether the motion during the sweep is estimated along with its pose, with the motion from the previous sweep as
    /// a prior. If not, the prediction deskews the sweep, the sweep is matched as a rigid body, and the motion from the
    /// previous sweep to the matched pose deskews it again (Deschaud 2018).
    pub continuous_time: bool,
    /// Largest number of rounds with the coarse radius and scale. A step below the fine scale ends them.
    pub coarse_rounds: u32,
    /// Largest number of rounds in total.
    pub max_rounds: u32,
    /// Search radius and robust scale of the coarse rounds.
    pub coarse: MatchScale,
    /// Search radius and robust scale of the fine rounds.
    pub fine: MatchScale,
    /// Expected velocity changes. They set the weight of the prior on the motion during a sweep: the motion from the
    /// previous sweep.
    pub acceleration: Acceleration,
    /// Residual error for the weight of that prior, m. Errors of neighbors are correlated, so it is larger than the
    /// range noise.
    pub residual_m: f64,
    /// Residual error for the covariance, m.
    pub drift_residual_m: f64,
    /// The fine rounds end at a translation step below this, m, and a rotation step below `small_step_rad`.
    pub small_step_m: f64,
    /// Largest rotation step that ends the fine rounds, see `small_step_m`, rad.
    pub small_step_rad: f64,
    /// A direction is degenerate if its mean squared influence on the residuals is below this (0 to 1; rotations at 10 m).
    pub min_influence: f64,
    /// Rough features are also matched if the least influence of any direction on the smooth ones is below this.
    pub rough_below: f64,
}

/// Map points used in a round of matching.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchScale {
    /// Map points within this distance of a feature form its surface, m.
    pub radius_m: f64,
    /// Scale of the Cauchy kernel for the residuals, m; infinite: least squares.
    pub scale_m: f64,
}

/// Velocity changes that a vehicle can reach within a sweep, as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// Change of the linear velocity, m/s^2.
    pub linear_mps2: f64,
    /// Change of the angular velocity, rad/s^2.
    pub angular_radps2: f64,
}

impl Default for MatchSettings {
    /// 2000 features average 3 cm of noise to below 1 mm. The coarse radius is the largest that the map's cells allow.
    /// The fine radius is 1.5 times the map's spacing, so that a surface is the mean of several points: the drift on
    /// the synthetic street of `tests/suite/support/world.rs` is 0.29, 0.31, 0.33 % with 0.3, 0.4, 0.5 m, and 0.58 %
    /// with the nearest point alone. 4 m/s^2 is hard braking. 0.7 rad/s^2 is a car pitching by 0.5 degrees at 1.4 Hz;
    /// with a weaker prior, noise distorts the sweep (same street: 0.29 % with 1.5, 0.22 % with 0.7). Normal errors of
    /// 3.6 degrees cause an influence of 0.004 along a tunnel; rough features are added below 0.005.
    fn default() -> Self {
        Self {
            sampling: Sampling::Even { spacing_m: 0.5, max_features: 2000 },
            weights: Weights::Compact,
            continuous_time: true,
            coarse_rounds: 3,
            max_rounds: 15,
            coarse: MatchScale { radius_m: 0.5, scale_m: 0.3 },
            fine: MatchScale { radius_m: 0.3, scale_m: 0.05 },
            acceleration: Acceleration { linear_mps2: 4.0, angular_radps2: 0.7 },
            residual_m: 0.1,
            drift_residual_m: 0.0115,
            small_step_m: 1e-3,
            small_step_rad: 1.745e-4,
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
    /// Number of features.
    pub n_features: usize,
    /// Number of features with a map point within the search radius.
    pub n_matches: usize,
    /// Weighted root mean square of the distances from the map's planes, m.
    pub rms_m: f64,
    /// Mean over the features of min(1, (distance / scale)^2), 1 for features without a match: 0 good, 1 bad.
    pub cost: f64,
    /// Least mean squared influence of any direction, see [`MatchSettings::min_influence`].
    pub least_influence: f64,
    /// Number of degenerate directions (0 to 6), in which the prediction is kept.
    pub n_degenerate_directions: u32,
    /// Inverse covariance of the pose: translation (m), then rotation (rad), in odom axes about the LiDAR, with independent errors
    /// of the features.
    pub information: Matrix6<f64>,
    /// Inverse covariance like `information`, but with [`MatchSettings::drift_residual_m`] and zero along degenerate
    /// directions. The covariance of a [`crate::Registered`] is computed from it.
    pub step_information: Matrix6<f64>,
    /// Whether the last step was below 5 cm and 5 mrad. Matches with larger last steps diverge or oscillate.
    pub converged: bool,
}

/// A match, and the nuisance parameters of the sensor estimated with it.
pub(crate) struct Match {
    pub matched: Matched,
    /// The ground's tilt after the match.
    pub ground_tilt: GroundTilt,
    /// Remaining common elevation error of all rings.
    pub elevation: RingError,
    /// Displacement of points without times after the match.
    pub turn: TurnShare,
    /// Sums per row of the range image.
    pub rings: Vec<RingSums>,
}

/// Prior knowledge of a match.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    /// The motion over the sweep.
    pub motion: SweepMotion,
    /// `odom_from_lidar` in the middle of the previous sweep. The motion since then is the prior of the motion during
    /// the sweep.
    pub previous: Pose,
    /// Seconds from the middle of the previous sweep to the middle of this one.
    pub seconds: f64,
    /// Seconds from first to last shot.
    pub duration_s: f64,
    /// Inverse covariance of the pose if sensors predicted it; zero for constant motion. Order and axes as in
    /// [`Matched::information`].
    pub information: Matrix6<f64>,
    /// The ground's tilt before the match.
    pub ground_tilt: GroundTilt,
    /// Remaining common elevation error of all rings.
    pub elevation: RingError,
    /// Share of the motion during a revolution by which points without times are displaced.
    pub turn: TurnShare,
    /// Lever of that share.
    pub turn_lever: TurnLever,
}

/// Rotations are converted to the displacement at this distance, m: a typical range in a street.
pub(crate) const LEVER_M: f64 = 10.0;
/// Fewer matches do not constrain six unknowns.
const MIN_MATCHES: usize = 60;
/// A match has converged if its last step is below this: the error of a prediction.
const CONVERGED_M: f64 = 0.05;
const CONVERGED_RAD: f64 = 5e-3;
/// Least deviation of the ground's tilt, rad: it keeps the equations regular.
const MIN_TILT_RAD: f64 = 1e-6;
/// Features of one parallel task; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 256;

/// Matches the sweep to the map, starting from the prediction. `None` if too few features have a match or the equations
/// are singular.
pub(crate) fn match_features(
    features: &[Feature],
    maps: &Maps,
    prediction: &Prediction,
    settings: &MatchSettings,
) -> Option<Match> {
    let mut motion = prediction.motion;
    let way = prediction.motion.mid.translation.vector - prediction.previous.translation.vector;
    let levers = Levers { ground: &GroundLever::for_motion(&way), turn: &prediction.turn_lever };
    let mut coarse_rounds = settings.coarse_rounds;
    for round in 0..settings.max_rounds {
        let coarse = round < coarse_rounds;
        let MatchScale { radius_m, scale_m } = if coarse { settings.coarse } else { settings.fine };
        let kernel = Kernel { radius_m, weights: settings.weights };
        // Equations 1 to 3.
        let equations = linearize(features, maps, &motion, levers, &kernel, scale_m);
        if equations.n_matches < MIN_MATCHES {
            return None;
        }
        // Equation 4.
        let degenerate = DegenerateDirections::from_equations(&equations, settings.min_influence);
        // Equation 5.
        let solution = solve(&equations, &degenerate, &motion, prediction, settings)?;
        let pose_step = solution.pose;
        let motion_step = solution.motion;
        motion = stepped(&motion, &pose_step, &motion_step);
        let step_is_below =
            |m: f64, rad: f64| pose_step.fixed_rows::<3>(0).norm() < m && pose_step.fixed_rows::<3>(3).norm() < rad;
        let small = step_is_below(settings.small_step_m, settings.small_step_rad);
        if coarse && step_is_below(settings.fine.scale_m, settings.fine.scale_m / LEVER_M) {
            coarse_rounds = 0;
        }
        let is_done = !coarse && small;
        if is_done || round + 1 == settings.max_rounds {
            if !settings.continuous_time {
                let velocity = Velocity::between(&prediction.previous, &motion.mid, prediction.seconds);
                motion = velocity.motion_at(motion.mid, prediction.duration_s);
            }
            let mean_square = equations.weighted_squares / equations.weight;
            let matched = Matched {
                motion,
                n_features: features.len(),
                n_matches: equations.n_matches,
                rms_m: mean_square.sqrt(),
                cost: equations.cost / features.len() as f64,
                least_influence: degenerate.least_influence,
                n_degenerate_directions: degenerate.n,
                // A floor of 1 mm keeps a perfect scene finite.
                information: equations.pose() / mean_square.max(1e-6),
                step_information: degenerate.determined / settings.drift_residual_m.powi(2),
                converged: step_is_below(CONVERGED_M, CONVERGED_RAD),
            };
            let square = settings.residual_m.powi(2);
            let [tilt, elevation, turn] = &solution.nuisances;
            return Some(Match {
                matched,
                ground_tilt: GroundTilt { mean: tilt.value, variance: tilt.cofactor * square },
                elevation: RingError { mean: elevation.value, variance: elevation.cofactor * square },
                turn: TurnShare::measured(turn.value, turn.cofactor * square),
                rings: equations.rings,
            });
        }
    }
    None
}

/// Derivatives of the residuals with respect to the nuisance parameters that depend on the motion.
#[derive(Clone, Copy)]
struct Levers<'a> {
    ground: &'a GroundLever,
    turn: &'a TurnLever,
}

/// Normal equations of the features at a given motion: equations 1 to 3.
fn linearize(
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    levers: Levers<'_>,
    kernel: &Kernel,
    scale_m: f64,
) -> NormalEquations {
    let part = |chunk: &[Feature]| {
        wide_loops::run(
            #[inline(always)]
            || linearize_chunk(chunk, maps, motion, levers, kernel, scale_m),
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
    levers: Levers<'_>,
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
        let Some(surface) = maps.map_for(feature).surface(position.into(), &normal.cast(), kernel) else {
            sum.cost += 1.0;
            continue;
        };
        let r = surface.distance_m;
        let squared = (r / scale_m).powi(2);
        sum.cost += squared.min(1.0);
        let weight = feature.weight() / (1.0 + squared);
        let of_nuisances = [
            levers.ground.at(&arm, &surface.normal),
            f64::from(feature.lever) - surface.lever,
            surface.turn_lever - levers.turn.at(&feature.position, &arm, &surface.normal),
        ];
        sum.add(&arm, &surface.normal, r, of_nuisances, weight, share);
        sum.add_to_ring(usize::from(feature.row), f64::from(feature.lever), surface.lever, r, weight);
    }
    sum
}

/// Directions of the pose that the scene hardly constrains.
struct DegenerateDirections {
    /// Information that keeps them at the prediction.
    prior: Matrix6<f64>,
    /// Contribution of the other directions to the normal equations.
    determined: Matrix6<f64>,
    least_influence: f64,
    n: u32,
}

impl DegenerateDirections {
    fn from_equations(equations: &NormalEquations, min_influence: f64) -> Self {
        let inverse_lever = Vector6::new(1.0, 1.0, 1.0, 1.0 / LEVER_M, 1.0 / LEVER_M, 1.0 / LEVER_M);
        let scale = Matrix6::from_diagonal(&inverse_lever);
        let eigen = (scale * equations.pose() * scale / equations.weight).symmetric_eigen();
        let mut found = Self { prior: Matrix6::zeros(), determined: Matrix6::zeros(), least_influence: f64::MAX, n: 0 };
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            found.least_influence = found.least_influence.min(value.max(0.0));
            let direction = vector.component_div(&inverse_lever);
            let square = direction * direction.transpose() * equations.weight;
            if *value < min_influence {
                found.n += 1;
                // A hundred times the information of a well-constrained direction.
                found.prior += square * 100.0;
            } else {
                found.determined += square * *value;
            }
        }
        found
    }
}

/// Steps of pose and motion, both as translation (m) and rotation vector (rad) in odom axes, and the nuisance
/// parameters.
fn solve(
    equations: &NormalEquations,
    degenerate: &DegenerateDirections,
    motion: &SweepMotion,
    prediction: &Prediction,
    settings: &MatchSettings,
) -> Option<Solution> {
    let to_predicted = step_between(&motion.mid, &prediction.motion.mid);
    let pose_prior = degenerate.prior + prediction.information * settings.residual_m.powi(2);
    let prior = |expected: f64, variance: f64| NuisancePrior {
        information: settings.residual_m.powi(2) / variance.max(MIN_TILT_RAD.powi(2)),
        expected,
    };
    let Prediction { ground_tilt, elevation, turn, .. } = prediction;
    let nuisances = [
        prior(ground_tilt.mean, ground_tilt.variance),
        prior(elevation.mean, elevation.variance),
        prior(turn.mean, turn.variance),
    ];
    if !settings.continuous_time {
        return equations.solve(&StepPrior { information: &pose_prior, step: &to_predicted }, None, nuisances);
    }
    let velocity = Velocity::between(&prediction.previous, &motion.mid, prediction.seconds);
    let expected = velocity.motion_at(motion.mid, prediction.duration_s);
    let rotation_gap = motion.mid.rotation * (expected.rotation - motion.rotation);
    let translation_gap = expected.translation - motion.translation;
    let mut to_expected = Vector6::zeros();
    to_expected.fixed_rows_mut::<3>(0).copy_from(&translation_gap);
    to_expected.fixed_rows_mut::<3>(3).copy_from(&rotation_gap);
    // The expected velocity applies halfway between both poses; see `Velocity::between`.
    let drift_s2 = prediction.duration_s.max(1e-3) * prediction.seconds / 2.0;
    let information = |acceleration: f64| (settings.residual_m / (acceleration * drift_s2)).powi(2);
    let Acceleration { linear_mps2, angular_radps2 } = settings.acceleration;
    let a = information(linear_mps2);
    let w = information(angular_radps2);
    let motion_prior = Matrix6::from_diagonal(&Vector6::new(a, a, a, w, w, w)) + degenerate.prior;
    let motion_prior = StepPrior { information: &motion_prior, step: &to_expected };
    equations.solve(&StepPrior { information: &pose_prior, step: &to_predicted }, Some(&motion_prior), nuisances)
}

/// Translation and rotation vector (odom axes) from one pose to the other.
fn step_between(from: &Pose, to: &Pose) -> Vector6<f64> {
    let mut step = Vector6::zeros();
    step.fixed_rows_mut::<3>(0).copy_from(&(to.translation.vector - from.translation.vector));
    step.fixed_rows_mut::<3>(3).copy_from(&(to.rotation * from.rotation.inverse()).scaled_axis());
    step
}

fn stepped(motion: &SweepMotion, pose_step: &Vector6<f64>, motion_step: &Vector6<f64>) -> SweepMotion {
    let step = UnitQuaternion::from_scaled_axis(pose_step.fixed_rows::<3>(3).into_owned());
    let mut rotation = step * motion.mid.rotation;
    // Rounding makes products of unit quaternions drift from unit length; messages check the length.
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
