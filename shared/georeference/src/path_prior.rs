//! A given path as measurements of the submaps.
//!
//! 1. Windows of half a second: mean position of the body by the path and by the odometry, and the mean rotation between
//!    both. Means remove the noise of single poses.
//! 2. Steps: where the path moves otherwise than the odometry between neighboring windows, it is wrong before or after.
//!    The parts between steps are moved to the offset that most of the drive has.
//! 3. Positions, verticals and headings of the windows are measurements in the pose graph.

use crate::georeferencer::NumberedSubmap;
use crate::median::median;
use crate::recent_path::RecentPath;
use crate::{AntennaPosition, Gauge, HorizontalVelocity, PoseGraph, Solution, Start, UpDirection};
use geometry::{Point3, Pose, Stamp, Trajectory, UnitQuaternion, Vector3};
use given_path::Deviation;
use nalgebra::Quaternion;
use serde::{Deserialize, Serialize};

/// Length of a window, ns, and of its samples.
const WINDOW_NANOS: i64 = 500_000_000;
const SAMPLE_NANOS: i64 = 10_000_000;
/// Least number of samples of a window.
const MIN_SAMPLES: usize = 25;
/// Time in which the errors of a solution repeat, s: windows within it count as one measurement, as for fixes.
const ERROR_CORRELATION_S: f64 = 8.0;
/// Least difference between path and odometry over two windows that is a step, m, and in units of the median difference. The
/// odometry is off by some millimetres over 10 m. 3.5 medians are 5 standard deviations of three axes: chosen on the path of
/// `tests/suite/refined.rs`.
const MIN_STEP_M: f64 = 0.06;
const MIN_STEP_MEDIANS: f64 = 3.5;
/// Windows on each side of a step whose mean gives its size: 3 s.
const SIDE: usize = 6;
/// Offsets within this distance are the same, m, and within the median difference.
const SAME_OFFSET_M: f64 = 0.05;
/// Offsets within this share of the largest step are the same: the odometry drifts between two steps.
const SAME_SHARE: f64 = 1.0 / 3.0;
/// Error of an offset that is measured by the odometry across a step, m.
const OFFSET_SIGMA_M: f64 = 0.02;
/// Independent poses of a window: a path of 10 Hz.
const INDEPENDENT_POSES: f64 = 5.0;
/// Least share of the stated deviation that lasts, because a scatter does not show what repeats.
const MIN_LASTING_SHARE: f64 = 0.2;
/// Least standard deviations of a measurement: 5 mm, 0.1 mrad.
const MIN_SIGMA_M: f64 = 0.005;
const MIN_SIGMA_RAD: f64 = 1e-4;

/// The windows of a drive.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct PathPrior {
    windows: Vec<Window>,
    /// Start of the next window.
    next: Option<i64>,
}

/// Means over a window.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Mean {
    /// Position of the body by the path.
    p_in_world: Vector3<f64>,
    /// Position of the body by the odometry.
    p_in_odom: Vector3<f64>,
    world_from_odom: UnitQuaternion<f64>,
    /// Standard deviations of single poses of the path against the odometry, towards east, north and up, m.
    scatter_m: Vector3<f64>,
}

/// A window.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Window {
    stamp: i64,
    submap: usize,
    mean: Mean,
    deviation: Deviation,
}

/// The steps of a path, for the operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathSteps {
    /// Number of steps.
    pub n: usize,
    /// Length of the largest one, m.
    pub largest_m: f64,
    /// Time of the largest one.
    pub at: i64,
    /// Share of the drive whose offset is used.
    pub share: f64,
}

/// The solution with a path.
pub(crate) struct RefinedPath {
    pub solution: Solution,
    pub steps: PathSteps,
    /// Standard deviations of the path at each submap.
    pub deviations: Vec<Deviation>,
}

impl PathPrior {
    pub fn is_empty(&self) -> bool {
        self.windows.is_empty()
    }

    /// Adds the windows that the odometry has passed.
    pub fn update(
        &mut self,
        odometry: &RecentPath,
        path: &Trajectory,
        deviation: impl Fn(Stamp) -> Deviation,
        submap_at: impl Fn(i64) -> Option<NumberedSubmap>,
    ) {
        let (Some(first), Some(last)) = (odometry.first(), odometry.last()) else { return };
        let mut begin = *self.next.get_or_insert(first);
        while begin + WINDOW_NANOS <= last {
            let middle = begin + WINDOW_NANOS / 2;
            if let Some(NumberedSubmap { number, .. }) = submap_at(middle) {
                let window = Mean::of(odometry, path, begin).map(|mean| Window {
                    stamp: middle,
                    submap: number,
                    mean,
                    deviation: deviation(Stamp(middle)),
                });
                self.windows.extend(window);
            }
            begin += WINDOW_NANOS;
        }
        self.next = Some(begin);
    }

    /// Solves for the poses of the submaps with the path. `graph` has the other measurements. `None` without windows.
    pub fn solve(&self, graph: &PoseGraph, odom_from_submap: &[Pose]) -> Option<RefinedPath> {
        let parts = Parts::new(&self.windows);
        let scatter_m = Vector3::from_fn(|axis, _| {
            median(self.windows.iter().map(|window| window.mean.scatter_m[axis])).unwrap_or(0.0)
        });
        let offsets = parts.offsets(&self.windows);
        let mut graph = graph.clone();
        let mut nearest: Vec<Option<&Window>> = vec![None; odom_from_submap.len()];
        let mut previous = i64::MIN;
        for (window, offset) in self.windows.iter().zip(&offsets) {
            let Some(pose) = odom_from_submap.get(window.submap) else { continue };
            let is_first = nearest[window.submap].is_none();
            nearest[window.submap].get_or_insert(window);
            if is_first {
                add_attitude(&mut graph, window, pose);
            }
            // Windows inside a step have no offset.
            let Some(offset) = offset else { continue };
            let pause_s = (window.stamp.saturating_sub(previous) as f64 * 1e-9).min(ERROR_CORRELATION_S);
            previous = window.stamp;
            let share = pause_s / ERROR_CORRELATION_S;
            let sigma_m = window.sigma_m(&scatter_m, share).map(|m| m.hypot(offset.sigma_m));
            graph.positions.push(AntennaPosition {
                submap: window.submap,
                p_in_submap: pose.inverse() * Point3::from(window.mean.p_in_odom),
                p_in_world: Point3::from(window.mean.p_in_world - offset.off),
                sigma_m,
                sigma_above_m: sigma_m[2],
                share,
                // Single means may be as far off as the path states.
                tolerance_m: window.deviation.east_north_up_m.into_iter().fold(MIN_SIGMA_M, f64::max),
            });
        }
        let start = start(&self.windows, &offsets, odom_from_submap)?;
        let mut solution = graph.solve_from(&start, Start::Aligned, Gauge::Positions)?;
        let of_submap = |number: usize| {
            let stamped = self.windows.partition_point(|window| window.submap < number).min(self.windows.len() - 1);
            self.windows[stamped].deviation
        };
        let deviations: Vec<Deviation> = (0..odom_from_submap.len()).map(of_submap).collect();
        solution.position_weights.clear();
        Some(RefinedPath { solution, steps: parts.steps(&self.windows), deviations })
    }
}

impl Window {
    /// Standard deviations of the mean position of a measurement with a weight of `share`. The scatter `scatter_m` of single poses is averaged
    /// within the window. The rest of the stated deviation repeats from window to window.
    fn sigma_m(&self, scatter_m: &Vector3<f64>, share: f64) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let stated = self.deviation.east_north_up_m[axis].max(MIN_SIGMA_M);
            let scatter = scatter_m[axis];
            let lasting = (stated * stated - scatter * scatter).max((MIN_LASTING_SHARE * stated).powi(2));
            (lasting + share * scatter * scatter / INDEPENDENT_POSES).sqrt()
        })
    }
}

impl Mean {
    /// The means over the window at `begin`; `None` if the path has gaps in it.
    fn of(odometry: &RecentPath, path: &Trajectory, begin: i64) -> Option<Self> {
        let mut n = 0.0;
        let mut p_in_world = Vector3::zeros();
        let mut p_in_odom = Vector3::zeros();
        let mut rotation = nalgebra::Vector4::zeros();
        for stamp in samples(begin) {
            let (Some(given), Some(own)) = (path.at(Stamp(stamp)), odometry.at(stamp)) else { continue };
            let found = (given.rotation * own.rotation.inverse()).coords;
            n += 1.0;
            p_in_world += given.translation.vector;
            p_in_odom += own.translation.vector;
            // Both signs are the same rotation.
            rotation += if rotation.dot(&found) < 0.0 { -found } else { found };
        }
        if n < MIN_SAMPLES as f64 {
            return None;
        }
        let mut mean = Self {
            p_in_world: p_in_world / n,
            p_in_odom: p_in_odom / n,
            world_from_odom: UnitQuaternion::from_quaternion(Quaternion::from(rotation)),
            scatter_m: Vector3::zeros(),
        };
        let mut squares = Vector3::zeros();
        for stamp in samples(begin) {
            let (Some(given), Some(own)) = (path.at(Stamp(stamp)), odometry.at(stamp)) else { continue };
            let off = (given.translation.vector - mean.p_in_world)
                - mean.world_from_odom * (own.translation.vector - mean.p_in_odom);
            squares += off.component_mul(&off);
        }
        mean.scatter_m = (squares / n).map(f64::sqrt);
        Some(mean)
    }

    /// The mean of at least one window.
    fn over(windows: &[Window]) -> Self {
        let n = windows.len() as f64;
        let mean =
            |of: fn(&Mean) -> Vector3<f64>| windows.iter().map(|window| of(&window.mean)).sum::<Vector3<f64>>() / n;
        let world_from_odom = windows[windows.len() / 2].mean.world_from_odom;
        let p_in_world = mean(|mean| mean.p_in_world);
        let p_in_odom = mean(|mean| mean.p_in_odom);
        Self { p_in_world, p_in_odom, world_from_odom, scatter_m: Vector3::zeros() }
    }

    /// Movement by the path minus movement by the odometry, world axes, m.
    fn difference(&self, later: &Self) -> Vector3<f64> {
        let rotation = self.world_from_odom.nlerp(&later.world_from_odom, 0.5);
        (later.p_in_world - self.p_in_world) - rotation * (later.p_in_odom - self.p_in_odom)
    }
}

/// Times of the samples of a window.
fn samples(begin: i64) -> impl Iterator<Item = i64> {
    (0..WINDOW_NANOS / SAMPLE_NANOS).map(move |sample| begin + sample * SAMPLE_NANOS)
}

/// Vertical and heading of a window as measurements of its submap.
fn add_attitude(graph: &mut PoseGraph, window: &Window, odom_from_submap: &Pose) {
    let [roll, pitch, heading] = window.deviation.roll_pitch_heading_rad;
    let submap_from_world = odom_from_submap.rotation.inverse() * window.mean.world_from_odom.inverse();
    graph.up_directions.push(UpDirection {
        submap: window.submap,
        up_in_submap: submap_from_world * Vector3::z(),
        sigma_rad: roll.max(pitch).max(MIN_SIGMA_RAD),
    });
    // A direction is a velocity of 1 m/s.
    let ahead = Vector3::x();
    let in_world = submap_from_world.inverse() * ahead;
    graph.velocities.push(HorizontalVelocity {
        submap: window.submap,
        v_in_submap: ahead,
        v_in_world: [in_world.x, in_world.y],
        sigma_mps: heading.max(MIN_SIGMA_RAD),
    });
}

/// Poses of the submaps by the windows nearest to them.
fn start(windows: &[Window], offsets: &[Option<Offset>], odom_from_submap: &[Pose]) -> Option<Vec<Pose>> {
    let known: Vec<(&Window, Vector3<f64>)> =
        windows.iter().zip(offsets).filter_map(|(window, offset)| Some((window, offset.as_ref()?.off))).collect();
    if known.is_empty() {
        return None;
    }
    let pose = |(number, odom_from_submap): (usize, &Pose)| {
        let at = known.partition_point(|(window, _)| window.submap < number).min(known.len() - 1);
        let (Window { mean, .. }, off) = known[at];
        let position =
            mean.p_in_world - off + mean.world_from_odom * (odom_from_submap.translation.vector - mean.p_in_odom);
        Pose::from_parts(position.into(), mean.world_from_odom * odom_from_submap.rotation)
    };
    Some(odom_from_submap.iter().enumerate().map(pose).collect())
}

/// Offset of the path in a window.
struct Offset {
    off: Vector3<f64>,
    sigma_m: f64,
}

/// Parts of the path between steps.
struct Parts {
    /// Index of the part of each window; `None` inside a step.
    part: Vec<Option<usize>>,
    /// Offset of each part from the first one, world axes, m.
    offsets: Vec<Vector3<f64>>,
    /// Offset that most of the drive has.
    common: Vector3<f64>,
    /// Largest distance of offsets that are the same, m.
    same_m: f64,
}

impl Parts {
    fn new(windows: &[Window]) -> Self {
        let across: Vec<f64> =
            windows.windows(3).map(|three| three[0].mean.difference(&three[2].mean).norm()).collect();
        let usual = median(across.iter().copied()).unwrap_or(0.0);
        let limit = (MIN_STEP_MEDIANS * usual).max(MIN_STEP_M);
        let is_step = |index: usize| index.checked_sub(1).and_then(|at| across.get(at)).is_some_and(|m| *m > limit);
        let mut part = vec![None; windows.len()];
        let mut offsets: Vec<Vector3<f64>> = Vec::new();
        let mut last: Option<usize> = None;
        for index in (0..windows.len()).filter(|index| !is_step(*index)) {
            match last {
                None => offsets.push(Vector3::zeros()),
                Some(last) if index > last + 1 => {
                    let after = index + (index..windows.len()).take(SIDE).take_while(|index| !is_step(*index)).count();
                    let before = last + 1 - (0..=last).rev().take(SIDE).take_while(|index| !is_step(*index)).count();
                    let off = Mean::over(&windows[before..=last]).difference(&Mean::over(&windows[index..after]));
                    offsets.push(offsets[offsets.len() - 1] + off);
                }
                Some(_) => {}
            }
            part[index] = Some(offsets.len() - 1);
            last = Some(index);
        }
        let all = part.iter().flatten();
        let common =
            Vector3::from_fn(|axis, _| median(all.clone().map(|number| offsets[*number][axis])).unwrap_or(0.0));
        let largest = offsets.windows(2).map(|pair| (pair[1] - pair[0]).norm()).fold(0.0, f64::max);
        Self { part, offsets, common, same_m: usual.max(SAME_OFFSET_M).max(largest * SAME_SHARE) }
    }

    /// Offset of each window; `None` inside a step.
    fn offsets(&self, windows: &[Window]) -> Vec<Option<Offset>> {
        let offset = |number: usize| {
            let off = self.offsets[number] - self.common;
            if off.norm() <= self.same_m {
                Offset { off: Vector3::zeros(), sigma_m: 0.0 }
            } else {
                Offset { off, sigma_m: OFFSET_SIGMA_M }
            }
        };
        windows.iter().zip(&self.part).map(|(_, part)| part.map(offset)).collect()
    }

    fn steps(&self, windows: &[Window]) -> PathSteps {
        let mut steps = PathSteps { n: self.offsets.len().saturating_sub(1), ..PathSteps::default() };
        for (number, pair) in self.offsets.windows(2).enumerate() {
            let length_m = (pair[1] - pair[0]).norm();
            if length_m > steps.largest_m {
                let first = self.part.iter().position(|part| *part == Some(number + 1)).unwrap_or(0);
                (steps.largest_m, steps.at) = (length_m, windows[first].stamp);
            }
        }
        let known = self.part.iter().flatten().count().max(1);
        let is_common = |number: &&usize| (self.offsets[**number] - self.common).norm() <= self.same_m;
        steps.share = self.part.iter().flatten().filter(is_common).count() as f64 / known as f64;
        steps
    }
}
