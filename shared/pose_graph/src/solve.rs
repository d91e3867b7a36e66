//! The poses that fit the measurements best.

use crate::elimination::{BlockSystem, Factored, Order};
use crate::factors::{OfOne, OfTwo};
use crate::graph::{PoseGraph, Relative};
use crate::tangent::moved;
use geometry::Pose;
use nalgebra::{Matrix6, Vector6};

/// What holds the submaps where they are if nothing else does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gauge {
    /// Positions do.
    Positions,
    /// The first submap keeps its place and heading; gravity says which way is up.
    FirstPlaceAndHeading,
    /// The first submap keeps its pose.
    FirstPose,
}

/// See [`PoseGraph::solve`].
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// `world_from_submap` by number.
    pub poses: Vec<Pose>,
    /// Covariance of each pose: translation (m), then rotation (rad), in the submap's axes.
    pub covariances: Vec<Matrix6<f64>>,
    /// How far each loop is believed, 0 to 1.
    pub loop_weights: Vec<f64>,
    /// The same of each position.
    pub position_weights: Vec<f64>,
}

/// Chi squared beyond which a loop (six numbers) or a position (three) counts less than a quarter: 99 of 100 true ones are
/// nearer.
const LOOP_SCALE: f64 = 16.8;
const POSITION_SCALE: f64 = 11.3;
/// From round to round outliers are believed less by this factor (Yang et al. 2020, section VI).
const SHARPENING: f64 = 1.4;
/// Steps at each stage of sharpening, and at the last one.
const STEPS_BETWEEN: u32 = 2;
const STEPS_AT_END: u32 = 50;
/// A step below this (m, rad) is the last.
const SMALL_STEP: f64 = 1e-7;
/// Stiffness of what the gauge holds: a micrometre, a microradian.
const HELD: f64 = 1e12;
/// And of what it does not, against numerical singularity alone: a kilometre.
const LOOSE: f64 = 1e-6;
/// Below this belief a measurement is called wrong.
const BELIEVED: f64 = 0.25;

impl Solution {
    /// How many of these weights are those of measurements that are believed.
    pub fn n_believed(weights: &[f64]) -> usize {
        weights.iter().filter(|weight| **weight >= BELIEVED).count()
    }
}

impl PoseGraph {
    /// Levenberg and Marquardt over all poses, from `start`, in which the number of a submap is its index. Loops and positions
    /// are judged by graduated non-convexity with the kernel of Geman and `McClure` (Yang et al., RA-L 2020): at first all
    /// count alike, then less and less those that do not fit. `None` if something is not determined, or a measurement is of a
    /// submap that `start` does not have.
    pub fn solve(&self, start: &[Pose], gauge: Gauge) -> Option<Solution> {
        if start.is_empty() || self.largest_number() >= start.len() {
            return None;
        }
        let pairs = self.odometry.iter().chain(&self.loops).map(|relative| (relative.target, relative.source));
        let problem = Problem { graph: self, gauge, start: start[0], order: Order::new(start.len(), pairs) };
        let mut poses = start.to_vec();
        let worst = problem.worst(&poses);
        let mut convexity = (2.0 * worst).max(1.0);
        loop {
            let is_last = convexity <= 1.0;
            let weights = problem.weights(&poses, convexity);
            for _ in 0..if is_last { STEPS_AT_END } else { STEPS_BETWEEN } {
                // At the end the weights follow each step.
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
        let covariances = problem.factored(&problem.system(&poses, &weights), 0.0)?.covariances();
        Some(Solution { poses, covariances, loop_weights: weights.loops, position_weights: weights.positions })
    }

    fn largest_number(&self) -> usize {
        let relatives = self.odometry.iter().chain(&self.loops).map(|relative| relative.target.max(relative.source));
        let positions = self.positions.iter().map(|position| position.submap);
        let uprights = self.uprights.iter().map(|upright| upright.submap);
        relatives.chain(positions).chain(uprights).max().unwrap_or(0)
    }
}

struct Problem<'a> {
    graph: &'a PoseGraph,
    gauge: Gauge,
    /// Where the first submap was put.
    start: Pose,
    order: Order,
}

struct JudgedWeights {
    loops: Vec<f64>,
    positions: Vec<f64>,
}

/// Weight of a measurement by its chi squared.
fn geman_mcclure(chi_squared: f64, scale: f64, convexity: f64) -> f64 {
    (convexity * scale / (chi_squared + convexity * scale)).powi(2)
}

impl Problem<'_> {
    fn chi_of_loop(&self, number: usize, poses: &[Pose]) -> f64 {
        let relative = &self.graph.loops[number];
        OfTwo::new(relative, &poses[relative.target], &poses[relative.source]).chi_squared(&relative.information)
    }

    fn chi_of_position(&self, number: usize, poses: &[Pose]) -> f64 {
        let position = &self.graph.positions[number];
        OfOne::of_position(position, &poses[position.submap]).chi_squared()
    }

    /// Largest chi squared in units of its scale.
    fn worst(&self, poses: &[Pose]) -> f64 {
        let loops = (0..self.graph.loops.len()).map(|number| self.chi_of_loop(number, poses) / LOOP_SCALE);
        let positions =
            (0..self.graph.positions.len()).map(|number| self.chi_of_position(number, poses) / POSITION_SCALE);
        loops.chain(positions).fold(0.0, f64::max)
    }

    fn weights(&self, poses: &[Pose], convexity: f64) -> JudgedWeights {
        let loops = 0..self.graph.loops.len();
        let positions = 0..self.graph.positions.len();
        JudgedWeights {
            loops: loops.map(|n| geman_mcclure(self.chi_of_loop(n, poses), LOOP_SCALE, convexity)).collect(),
            positions: positions
                .map(|n| geman_mcclure(self.chi_of_position(n, poses), POSITION_SCALE, convexity))
                .collect(),
        }
    }

    /// One step downhill; how long it was (the longest of any pose), 0 if there is no way down.
    fn improve(&self, poses: &mut Vec<Pose>, weights: &JudgedWeights) -> Option<f64> {
        let system = self.system(poses, weights);
        let cost = self.cost(poses, weights);
        let mut damping = 0.0;
        // From an undamped step to one of a micrometre: sixteen tenfold dampings.
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

    fn system(&self, poses: &[Pose], weights: &JudgedWeights) -> BlockSystem {
        let mut system = BlockSystem::new(poses.len());
        let mut add = |relative: &Relative, weight: f64| {
            let OfTwo { residual, by_target, by_source } =
                OfTwo::new(relative, &poses[relative.target], &poses[relative.source]);
            let information = relative.information * weight;
            let (pull_target, pull_source) = (by_target.transpose() * information, by_source.transpose() * information);
            system.add_diagonal(relative.target, &(pull_target * by_target));
            system.add_diagonal(relative.source, &(pull_source * by_source));
            system.add_beside(relative.target, relative.source, &(pull_target * by_source));
            system.add_gradient(relative.target, &(pull_target * residual));
            system.add_gradient(relative.source, &(pull_source * residual));
        };
        self.graph.odometry.iter().for_each(|relative| add(relative, 1.0));
        self.graph.loops.iter().zip(&weights.loops).for_each(|(relative, weight)| add(relative, *weight));
        let mut add = |submap: usize, of_one: OfOne, weight: f64| {
            let pull = of_one.jacobian.transpose() * weight;
            system.add_diagonal(submap, &(pull * of_one.jacobian));
            system.add_gradient(submap, &(pull * of_one.residual));
        };
        for (position, weight) in self.graph.positions.iter().zip(&weights.positions) {
            let of_one = OfOne::of_position(position, &poses[position.submap]);
            add(position.submap, of_one, weight * position.share);
        }
        for upright in &self.graph.uprights {
            add(upright.submap, OfOne::of_upright(upright, &poses[upright.submap]), 1.0);
        }
        let (held, off, by_first) = self.held(&poses[0]);
        let pull = by_first.transpose() * held;
        system.add_diagonal(0, &(pull * by_first));
        system.add_gradient(0, &(pull * off));
        system
    }

    /// Stiffness by axis, distance and derivative of what the gauge holds: place in the world's axes, rotation in the first
    /// submap's, whose z is up within some degrees.
    fn held(&self, first: &Pose) -> (Matrix6<f64>, Vector6<f64>, Matrix6<f64>) {
        let stiffness = match self.gauge {
            Gauge::Positions => [LOOSE; 6],
            Gauge::FirstPlaceAndHeading => [HELD, HELD, HELD, LOOSE, LOOSE, HELD],
            Gauge::FirstPose => [HELD; 6],
        };
        let mut off = Vector6::zeros();
        off.fixed_rows_mut::<3>(0).copy_from(&(first.translation.vector - self.start.translation.vector));
        off.fixed_rows_mut::<3>(3).copy_from(&(self.start.rotation.inverse() * first.rotation).scaled_axis());
        let mut by_first = Matrix6::identity();
        by_first.fixed_view_mut::<3, 3>(0, 0).copy_from(first.rotation.to_rotation_matrix().matrix());
        (Matrix6::from_diagonal(&Vector6::from(stiffness)), off, by_first)
    }

    fn cost(&self, poses: &[Pose], weights: &JudgedWeights) -> f64 {
        let chi = |relative: &Relative| {
            OfTwo::new(relative, &poses[relative.target], &poses[relative.source]).chi_squared(&relative.information)
        };
        let odometry: f64 = self.graph.odometry.iter().map(chi).sum();
        let loops: f64 =
            self.graph.loops.iter().zip(&weights.loops).map(|(relative, weight)| weight * chi(relative)).sum();
        let positions: f64 = self
            .graph
            .positions
            .iter()
            .zip(&weights.positions)
            .map(|(p, weight)| weight * p.share * OfOne::of_position(p, &poses[p.submap]).chi_squared())
            .sum();
        let uprights: f64 =
            self.graph.uprights.iter().map(|u| OfOne::of_upright(u, &poses[u.submap]).chi_squared()).sum();
        let (held, off, _) = self.held(&poses[0]);
        odometry + loops + positions + uprights + off.dot(&(held * off))
    }
}
