//! Robust least squares over the poses of the submaps.

use super::bend::add_bend;
use super::elimination::{BlockSystem, Factored, Order};
use super::factors::{RelativeFactor, UnaryFactor};
use super::measurements::{PoseGraph, RelativePose};
use super::tangent::moved;
use geometry::Pose;
use nalgebra::{Matrix6, Vector6};

/// Constraints on the degrees of freedom that the measurements leave unconstrained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gauge {
    /// The positions constrain all degrees of freedom.
    Positions,
    /// The first submap keeps its position; velocities constrain the heading, gravity or the start roll and pitch.
    FirstPosition,
    /// The first submap keeps its position and heading; gravity constrains roll and pitch.
    FirstPositionAndHeading,
    /// The first submap keeps its pose.
    FirstPose,
}

/// Trust in the start of [`PoseGraph::solve`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// No trust: all measurements have the same initial weight.
    Guess,
    /// It fits the inliers. Measurements far from it are outliers from the first round on, so a minority cannot pull the
    /// solution away.
    Aligned,
}

/// Result of [`PoseGraph::solve`].
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// `world_from_submap` by number.
    pub poses: Vec<Pose>,
    /// Covariance of each pose: translation (m), then rotation (rad), in the submap's axes.
    pub covariances: Vec<Matrix6<f64>>,
    /// Weight of each loop closure, 0 outlier to 1 inlier.
    pub loop_weights: Vec<f64>,
    /// Weight of each position, 0 outlier to 1 inlier.
    pub position_weights: Vec<f64>,
}

/// Chi squared beyond which a loop closure (six degrees of freedom) or a position (three) has less than a quarter of
/// the weight: the 99 % quantiles.
const LOOP_SCALE: f64 = 16.8;
const POSITION_SCALE: f64 = 11.3;
/// The 99 % quantile of chi squared for a velocity (two degrees of freedom).
const VELOCITY_SCALE: f64 = 9.2;
/// Share of the measurements that are inliers after an aligned start; their chi squared is at most [`SURE_CHI`] times
/// its scale.
const SURE_SHARE: f64 = 0.25;
const SURE_CHI: f64 = 4.0;
/// Factor by which the kernel becomes less convex from round to round (Yang et al. 2020, section VI).
const SHARPENING: f64 = 1.4;
/// Number of steps in each round, and in the last one.
const STEPS_BETWEEN: u32 = 2;
const STEPS_AT_END: u32 = 50;
/// A step below this (m, rad) ends a round.
const SMALL_STEP: f64 = 1e-7;
/// Information on the degrees of freedom fixed by the gauge: a micrometre, a microradian.
const FIXED: f64 = 1e12;
/// Information on the other degrees of freedom, only to avoid numerical singularity: a kilometre.
const FREE: f64 = 1e-6;
/// Least weight of an inlier.
const MIN_INLIER_WEIGHT: f64 = 0.25;

impl Solution {
    /// Number of weights that belong to inliers.
    pub fn n_inliers(weights: &[f64]) -> usize {
        weights.iter().filter(|weight| **weight >= MIN_INLIER_WEIGHT).count()
    }
}

impl PoseGraph {
    /// Levenberg-Marquardt over all poses, starting from `start`, which has a pose for each submap. Loop closures and
    /// positions are weighted by graduated non-convexity with the kernel of Geman and `McClure` (Yang et al., RA-L
    /// 2020): all weights start equal, and the weights of large residuals decrease from round to round. `None` if a
    /// pose is undetermined, or if a measurement refers to a submap that `start` does not have.
    pub fn solve(&self, start: &[Pose], gauge: Gauge) -> Option<Solution> {
        self.solve_from(start, Start::Guess, gauge)
    }

    /// Solves like [`Self::solve`], with the given trust in the start.
    pub fn solve_from(&self, start: &[Pose], trust: Start, gauge: Gauge) -> Option<Solution> {
        if start.is_empty() || self.largest_number() >= start.len() {
            return None;
        }
        let pairs = self.odometry.iter().chain(&self.loops).map(|relative| (relative.target, relative.source));
        let problem = Problem { graph: self, gauge, start: start[0], order: Order::new(start.len(), pairs) };
        let mut poses = start.to_vec();
        let mut convexity = match trust {
            Start::Guess => 2.0 * problem.quantile(&poses, 1.0),
            Start::Aligned => SURE_CHI * problem.quantile(&poses, SURE_SHARE),
        }
        .max(1.0);
        loop {
            let is_last = convexity <= 1.0;
            let weights = problem.weights(&poses, convexity);
            for _ in 0..if is_last { STEPS_AT_END } else { STEPS_BETWEEN } {
                // In the last round the weights are updated with each step.
                let weights = if is_last { &problem.weights(&poses, 1.0) } else { &weights };
                if problem.improve(&mut poses, weights)? < SMALL_STEP {
                    break;
                }
            }
            if is_last {
                break;
            }
            convexity = (convexity / SHARPENING).max(1.0);
        }
        let weights = problem.weights(&poses, 1.0);
        let factored = problem.factored(&problem.system(&poses, &weights), 0.0)?;
        let mut covariances = factored.covariances();
        add_bend(&mut covariances, self, &poses, &factored);
        Some(Solution { poses, covariances, loop_weights: weights.loops, position_weights: weights.positions })
    }

    fn largest_number(&self) -> usize {
        let relatives = self.odometry.iter().chain(&self.loops).map(|relative| relative.target.max(relative.source));
        let positions = self.positions.iter().map(|position| position.submap);
        let up_directions = self.up_directions.iter().map(|up_direction| up_direction.submap);
        let velocities = self.velocities.iter().map(|velocity| velocity.submap);
        relatives.chain(positions).chain(up_directions).chain(velocities).max().unwrap_or(0)
    }
}

/// The gauge as a measurement of the first submap: position in world axes, rotation in axes of the submap, whose z axis
/// is vertical within some degrees.
struct GaugePrior {
    information: Matrix6<f64>,
    residual: Vector6<f64>,
    jacobian: Matrix6<f64>,
}

struct Problem<'a> {
    graph: &'a PoseGraph,
    gauge: Gauge,
    /// Start pose of the first submap.
    start: Pose,
    order: Order,
}

struct RobustWeights {
    loops: Vec<f64>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
}

/// Weight of a measurement as a function of its chi squared.
fn geman_mcclure(chi_squared: f64, scale: f64, convexity: f64) -> f64 {
    (convexity * scale / (chi_squared + convexity * scale)).powi(2)
}

impl Problem<'_> {
    fn chi_of_loop(&self, number: usize, poses: &[Pose]) -> f64 {
        let relative = &self.graph.loops[number];
        RelativeFactor::new(relative, &poses[relative.target], &poses[relative.source])
            .chi_squared(&relative.information)
    }

    fn chi_of_position(&self, number: usize, poses: &[Pose]) -> f64 {
        let position = &self.graph.positions[number];
        UnaryFactor::from_position(position, &poses[position.submap]).chi_squared()
    }

    /// Chi squared of a position for the outlier test.
    fn chi_of_position_with_tolerance(&self, number: usize, poses: &[Pose]) -> f64 {
        let position = &self.graph.positions[number];
        let sigma_m = position.sigma_m[0].min(position.sigma_m[1]);
        self.chi_of_position(number, poses) * (sigma_m / position.tolerance_m.max(sigma_m)).powi(2)
    }

    fn chi_of_velocity(&self, number: usize, poses: &[Pose]) -> f64 {
        let velocity = &self.graph.velocities[number];
        UnaryFactor::from_velocity(velocity, &poses[velocity.submap]).chi_squared()
    }

    /// Quantile `share` of the chi squared of the measurements, in units of its scale; the largest of all kinds of
    /// measurement.
    fn quantile(&self, poses: &[Pose], share: f64) -> f64 {
        let PoseGraph { loops, positions, velocities, .. } = self.graph;
        let of = |mut chis: Vec<f64>| {
            chis.sort_by(f64::total_cmp);
            let last = chis.len().checked_sub(1);
            last.map_or(0.0, |last| chis[(share * last as f64) as usize])
        };
        let loops = (0..loops.len()).map(|n| self.chi_of_loop(n, poses) / LOOP_SCALE);
        let positions = (0..positions.len()).map(|n| self.chi_of_position_with_tolerance(n, poses) / POSITION_SCALE);
        let velocities = (0..velocities.len()).map(|n| self.chi_of_velocity(n, poses) / VELOCITY_SCALE);
        of(loops.collect()).max(of(positions.collect())).max(of(velocities.collect()))
    }

    fn weights(&self, poses: &[Pose], convexity: f64) -> RobustWeights {
        let loop_weight = |n| geman_mcclure(self.chi_of_loop(n, poses), LOOP_SCALE, convexity);
        let position_weight =
            |n| geman_mcclure(self.chi_of_position_with_tolerance(n, poses), POSITION_SCALE, convexity);
        let velocity_weight = |n| geman_mcclure(self.chi_of_velocity(n, poses), VELOCITY_SCALE, convexity);
        RobustWeights {
            loops: (0..self.graph.loops.len()).map(loop_weight).collect(),
            positions: (0..self.graph.positions.len()).map(position_weight).collect(),
            velocities: (0..self.graph.velocities.len()).map(velocity_weight).collect(),
        }
    }

    /// One step that lowers the cost. Returns its length (the longest of any pose); 0 if no step lowers the cost.
    fn improve(&self, poses: &mut Vec<Pose>, weights: &RobustWeights) -> Option<f64> {
        let system = self.system(poses, weights);
        let cost = self.cost(poses, weights);
        let mut damping = 0.0;
        // Sixteen tenfold increases of the damping reduce a full step to one of a micrometre.
        for _ in 0..16 {
            let gradient: Vec<Vector6<f64>> = system.gradient().iter().map(|g| -g).collect();
            let step = self.factored(&system, damping)?.solve(&gradient);
            let after: Vec<Pose> = poses.iter().zip(&step).map(|(pose, step)| moved(pose, step)).collect();
            if self.cost(&after, weights) <= cost {
                *poses = after;
                return Some(step.iter().map(Vector6::norm).fold(0.0, f64::max));
            }
            damping = if damping == 0.0 { 1e-6 } else { damping * 10.0 };
        }
        Some(0.0)
    }

    fn factored(&self, system: &BlockSystem, damping: f64) -> Option<Factored> {
        system.clone().damped(damping).factor(&self.order)
    }

    fn system(&self, poses: &[Pose], weights: &RobustWeights) -> BlockSystem {
        let mut system = BlockSystem::new(poses.len());
        let mut add = |relative: &RelativePose, weight: f64| {
            let RelativeFactor { residual, by_target, by_source } =
                RelativeFactor::new(relative, &poses[relative.target], &poses[relative.source]);
            let information = relative.information * weight;
            let target_weighted = by_target.transpose() * information;
            let source_weighted = by_source.transpose() * information;
            system.add_diagonal(relative.target, &(target_weighted * by_target));
            system.add_diagonal(relative.source, &(source_weighted * by_source));
            system.add_off_diagonal(relative.target, relative.source, &(target_weighted * by_source));
            system.add_gradient(relative.target, &(target_weighted * residual));
            system.add_gradient(relative.source, &(source_weighted * residual));
        };
        self.graph.odometry.iter().for_each(|relative| add(relative, 1.0));
        self.graph.loops.iter().zip(&weights.loops).for_each(|(relative, weight)| add(relative, *weight));
        let mut add = |submap: usize, factor: UnaryFactor, weight: f64| {
            let weighted = factor.jacobian.transpose() * weight;
            system.add_diagonal(submap, &(weighted * factor.jacobian));
            system.add_gradient(submap, &(weighted * factor.residual));
        };
        for (position, weight) in self.graph.positions.iter().zip(&weights.positions) {
            let factor = UnaryFactor::from_position(position, &poses[position.submap]);
            add(position.submap, factor, weight * position.share);
        }
        for (velocity, weight) in self.graph.velocities.iter().zip(&weights.velocities) {
            add(velocity.submap, UnaryFactor::from_velocity(velocity, &poses[velocity.submap]), *weight);
        }
        for up_direction in &self.graph.up_directions {
            add(up_direction.submap, UnaryFactor::from_up_direction(up_direction, &poses[up_direction.submap]), 1.0);
        }
        let GaugePrior { information, residual, jacobian } = self.gauge_prior(&poses[0]);
        let weighted = jacobian.transpose() * information;
        system.add_diagonal(0, &(weighted * jacobian));
        system.add_gradient(0, &(weighted * residual));
        system
    }

    fn gauge_prior(&self, first: &Pose) -> GaugePrior {
        let information = match self.gauge {
            Gauge::Positions => [FREE; 6],
            Gauge::FirstPosition => [FIXED, FIXED, FIXED, FREE, FREE, FREE],
            Gauge::FirstPositionAndHeading => [FIXED, FIXED, FIXED, FREE, FREE, FIXED],
            Gauge::FirstPose => [FIXED; 6],
        };
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(first.translation.vector - self.start.translation.vector));
        residual.fixed_rows_mut::<3>(3).copy_from(&(self.start.rotation.inverse() * first.rotation).scaled_axis());
        let mut jacobian = Matrix6::identity();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(first.rotation.to_rotation_matrix().matrix());
        GaugePrior { information: Matrix6::from_diagonal(&Vector6::from(information)), residual, jacobian }
    }

    fn cost(&self, poses: &[Pose], weights: &RobustWeights) -> f64 {
        let chi = |relative: &RelativePose| {
            RelativeFactor::new(relative, &poses[relative.target], &poses[relative.source])
                .chi_squared(&relative.information)
        };
        let odometry: f64 = self.graph.odometry.iter().map(chi).sum();
        let loops: f64 =
            self.graph.loops.iter().zip(&weights.loops).map(|(relative, weight)| weight * chi(relative)).sum();
        let positions: f64 = self
            .graph
            .positions
            .iter()
            .zip(&weights.positions)
            .map(|(p, weight)| weight * p.share * UnaryFactor::from_position(p, &poses[p.submap]).chi_squared())
            .sum();
        let velocities: f64 =
            weights.velocities.iter().enumerate().map(|(n, weight)| weight * self.chi_of_velocity(n, poses)).sum();
        let up_directions: f64 = self
            .graph
            .up_directions
            .iter()
            .map(|u| UnaryFactor::from_up_direction(u, &poses[u.submap]).chi_squared())
            .sum();
        let GaugePrior { information, residual, .. } = self.gauge_prior(&poses[0]);
        odometry + loops + positions + velocities + up_directions + residual.dot(&(information * residual))
    }
}
