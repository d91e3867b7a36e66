//! Collects the measurements of a drive and places its submaps at the end.

use crate::drift::Drift;
use crate::fixes::{Fix, Fixes};
use crate::gravity::Gravity;
use crate::path_prior::{PathPrior, PathSteps, RefinedPath};
use crate::placing::{MIN_SPREAD_M, place_by_fixes};
use crate::receiver_clock::estimated_delay;
use crate::recent_path::RecentPath;
use crate::{Gauge, Keyframe, LoopFinder, Places, PoseGraph, ReceiverDelay, RelativePose, Solution, Start};
use doubts::Doubt;
use geometry::{Geodetic, Point3, Pose, Stamp, Trajectory};
use given_path::Deviation;
use messages::{FRAME_EAST_NORTH_UP, FRAME_LOCAL, GnssRow, ImuRow, PlacementHeader, PlacementRow, PoseDeviation};
use nalgebra::Matrix6;
use registration::{GroundVelocity, LocalMap, Registered};
use serde::{Deserialize, Serialize};

/// Number of the last fixes that determine the delay of the receiver during the drive: half a minute or more.
const RECENT_FIXES: usize = 64;
/// Standard deviation of the delay before it is measured, s: NMEA sentences over a serial line take 0.05 to 0.3 s.
const UNKNOWN_DELAY_S: f64 = 0.2;
/// A submap gets a keyframe only after this path length since the last one, m: a standing vehicle measures nothing new.
const KEYFRAME_M: f64 = 5.0;
/// Selection of measurements, and mounting of the sensors.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::struct_excessive_bools, reason = "independent switches")]
pub struct GeoreferenceSettings {
    /// Use the fixes of the GNSS receiver.
    pub gnss: bool,
    /// Use the direction of gravity.
    pub imu: bool,
    /// Search loop closures.
    pub loops: bool,
    /// Invert the smoothing filter of the GNSS receiver where one is detected.
    pub unsmooth_fixes: bool,
    /// Position of the GNSS antenna, m.
    pub antenna_in_body: Point3<f64>,
    /// Position of the inertial unit, m.
    pub imu_in_body: Point3<f64>,
    /// Origin of the world, if the drive names one.
    pub origin: Option<Geodetic>,
    /// Largest number of places kept for loop closures.
    pub max_keyframes: usize,
}

/// A submap from the odometry.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Node {
    odom_from_submap: Pose,
    stamp: i64,
}

/// The measurements so far. Serializing it saves the state. Memory in submaps of 20 m: 43 kB per km, 240 bytes for each
/// fix (up to twice that while vectors grow), and up to 4 MB per km of places that were not visited before, until
/// [`GeoreferenceSettings::max_keyframes`] are reached. Sensor data that wait for the odometry are bounded.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Georeferencer {
    nodes: Vec<Node>,
    graph: PoseGraph,
    drift: Drift,
    path: RecentPath,
    fixes: Fixes,
    gravity: Gravity,
    path_m: f64,
    places: Places,
    /// A given path as measurements.
    prior: PathPrior,
}

/// Poses of the submaps in the world.
pub struct Placed {
    /// Frame of the world, and numbers of measurements used and rejected.
    pub header: PlacementHeader,
    /// One for each submap.
    pub rows: Vec<PlacementRow>,
    /// Use of the fixes in the result.
    pub fixes: FixUse,
    /// The doubt about fixes whose path differs from the odometry in size or shape.
    pub shape: Option<Doubt>,
    /// Steps of the given path, if it is a measurement.
    pub steps: Option<PathSteps>,
    /// One line for the operator.
    pub summary: String,
}

/// Use of the fixes within the time of the trajectory. Fixes that follow others too closely are skipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixUse {
    /// Number of fixes within the time of the trajectory.
    pub n: usize,
    /// Number of fixes that agree with the result. 0 unless the result is georeferenced.
    pub n_used: usize,
    /// Root mean square distance of the fixes from their center, m.
    pub spread_m: f64,
    /// Delay of the receiver's stamps, if its velocities show one. It is corrected unless it is out of range.
    pub delay: Option<ReceiverDelay>,
}

impl FixUse {
    /// Reason why the fixes do not georeference the result; empty if they do, or if they disagree with it.
    pub fn reason(&self) -> String {
        match self.n {
            0 => "no fixes".to_owned(),
            n if self.spread_m < MIN_SPREAD_M => {
                let spread_m = self.spread_m;
                format!("{n} fixes have a spread of {spread_m:.1} m; {MIN_SPREAD_M} m are needed to determine north")
            }
            _ => String::new(),
        }
    }
}

impl Georeferencer {
    /// Creates a georeferencer without measurements.
    pub fn new(settings: &GeoreferenceSettings) -> Self {
        Self { fixes: Fixes::with_origin(settings.origin), ..Self::default() }
    }

    /// Adds fixes in time order. Returns the number of fixes with a valid position. Fixes are kept only if they are
    /// used.
    pub fn add_gnss(&mut self, rows: &[GnssRow], settings: &GeoreferenceSettings) -> usize {
        let mut n_valid = 0;
        for fix in rows.iter().filter_map(Fix::new) {
            n_valid += 1;
            if settings.gnss {
                self.fixes.push(fix);
            }
        }
        n_valid
    }

    /// The velocity of a fix with the delay that the last fixes show; `None` if the delay is out of range.
    pub fn velocity(&self, row: &GnssRow) -> Option<GroundVelocity> {
        let velocity = GroundVelocity::from_fix(row)?;
        let used = self.fixes.used();
        let Some(delay) = estimated_delay(&used[used.len().saturating_sub(RECENT_FIXES)..]) else {
            return Some(velocity.with_delay(0.0, UNKNOWN_DELAY_S));
        };
        let late_s = if delay.is_significant() { delay.late_s } else { 0.0 };
        (!delay.is_out_of_range()).then(|| velocity.with_delay(late_s, delay.sigma_s.min(UNKNOWN_DELAY_S)))
    }

    /// Adds inertial samples in time order. They are kept only if they are used.
    pub fn add_imu(&mut self, rows: &[ImuRow], settings: &GeoreferenceSettings) {
        for row in rows.iter().filter(|_| settings.imu) {
            self.gravity.push(row);
        }
    }

    /// Drops all measurements from inertial samples, because the samples were wrong.
    pub fn forget_imu(&mut self) {
        self.gravity = Gravity::default();
        self.graph.up_directions.clear();
    }

    /// Starts a submap; the next sweep is its first one.
    pub fn begin_submap(&mut self, odom_from_submap: Pose, stamp: i64) {
        let source = self.nodes.len();
        if let Some(before) = self.nodes.last() {
            self.graph.odometry.push(RelativePose {
                target: source - 1,
                source,
                target_from_source: before.odom_from_submap.inv_mul(&odom_from_submap),
                information: self.drift.information(&before.odom_from_submap),
            });
            self.graph.bent_m.push(self.drift.bent_m());
        }
        self.drift = Drift::default();
        self.nodes.push(Node { odom_from_submap, stamp });
    }

    /// Adds a sweep to the open submap. `begin` and `end` are `odom_from_body` at its first and last shot.
    pub fn add_sweep(&mut self, registered: &Registered, begin: &Pose, end: &Pose) {
        let begin_stamp = registered.stamp.0;
        let end_stamp = registered.end_stamp().0;
        // Sweeps follow each other without gaps, except for lost packets.
        let previous = self.path.last().and_then(|last| self.path.at(last));
        let path_m = previous.map_or(0.0, |previous| (previous.translation.vector - end.translation.vector).norm());
        self.path_m += path_m;
        self.drift.add(registered, path_m);
        for (stamp, pose) in [(begin_stamp, begin), (end_stamp, end)] {
            if self.path.last().is_none_or(|last| last < stamp) {
                self.path.push(stamp, *pose);
            }
        }
    }

    /// Ends the open submap and searches loop closures. `map` is the current map of the odometry. Returns whether a
    /// loop was closed.
    pub fn end_submap(&mut self, settings: &GeoreferenceSettings, map: &LocalMap) -> bool {
        let (Some(node), Some(stamp)) = (self.nodes.last(), self.path.last()) else { return false };
        let Some(odom_from_body) = self.path.at(stamp).filter(|_| settings.loops) else { return false };
        let last_path_m = self.places.last().map_or(f64::NEG_INFINITY, |last| last.path_m);
        if self.path_m - last_path_m < KEYFRAME_M {
            return false;
        }
        let number = self.nodes.len() - 1;
        let keyframe = Keyframe::new(number, self.path_m, &map.points(), &node.odom_from_submap, &odom_from_body);
        let closure = self.places.visit(keyframe, &LoopFinder::default(), settings.max_keyframes);
        let is_closed = closure.is_some();
        self.graph.loops.extend(closure.map(|closure| closure.relative));
        is_closed
    }

    /// Converts the sensor data up to the last sweep to measurements of submaps.
    pub fn update(&mut self, settings: &GeoreferenceSettings) {
        let Self { nodes, graph, path, fixes, gravity, .. } = self;
        let submap_at = |stamp: i64| submap_at(nodes, stamp);
        if settings.gnss {
            fixes.update(path, &settings.antenna_in_body, submap_at, false);
        }
        if settings.imu {
            gravity.update(path, &settings.imu_in_body, submap_at, &mut graph.up_directions);
        }
    }

    /// Uses a given path up to the last sweep as a measurement. `deviation`: its standard deviations at a time.
    pub fn add_path(&mut self, path: &Trajectory, deviation: impl Fn(Stamp) -> Deviation) {
        let Self { nodes, path: odometry, prior, .. } = self;
        prior.update(odometry, path, deviation, |stamp| submap_at(nodes, stamp));
    }

    /// Places the submaps by the given path and the other measurements.
    fn solve_with_path(&self, odom_from_submap: &[Pose], origin: Option<Geodetic>) -> Option<Placed> {
        let RefinedPath { solution, steps, deviations } = self.prior.solve(&self.graph, odom_from_submap)?;
        let header = header(&solution, self.graph.up_directions.len(), origin);
        let mut rows = self.rows(&solution);
        // Errors of a solution may last for the whole drive.
        for (row, deviation) in rows.iter_mut().zip(&deviations) {
            let [east, north, up] = deviation.east_north_up_m.map(|m| m as f32);
            let [roll, pitch, heading] = deviation.roll_pitch_heading_rad.map(|rad| rad as f32);
            let least_m = [east.max(north), east.max(north), up];
            row.sigma_m = std::array::from_fn(|axis| row.sigma_m[axis].max(least_m[axis]));
            let least_rad = [roll, pitch, heading];
            row.sigma_rad = std::array::from_fn(|axis| row.sigma_rad[axis].max(least_rad[axis]));
        }
        let fixes = FixUse { n: 0, n_used: 0, spread_m: 0.0, delay: None };
        let summary = format!(
            "refined the given path over {} submaps; {} steps of the path, the largest {:.2} m; {:.0} % of the path has the offset that is used",
            rows.len(),
            steps.n,
            steps.largest_m,
            steps.share * 100.0
        );
        Some(Placed { header, rows, fixes, shape: None, steps: Some(steps), summary })
    }

    /// Solves for the poses of all submaps with all measurements, at the end of the drive. `None` without submaps.
    pub fn solve(&mut self, settings: &GeoreferenceSettings) -> Option<Placed> {
        let Self { nodes, graph, path, fixes, gravity, .. } = self;
        let submap_at = |stamp: i64| submap_at(nodes, stamp);
        gravity.close(path, &settings.imu_in_body, submap_at, &mut graph.up_directions);
        if settings.gnss {
            fixes.update(path, &settings.antenna_in_body, submap_at, true);
        }
        if self.nodes.is_empty() {
            return None;
        }
        let odom_from_submap: Vec<Pose> = self.nodes.iter().map(|node| node.odom_from_submap).collect();
        if !self.prior.is_empty() {
            return self.solve_with_path(&odom_from_submap, settings.origin);
        }
        let placing = place_by_fixes(
            &self.graph,
            &odom_from_submap,
            self.fixes.used(),
            self.fixes.origin().as_ref(),
            settings.unsmooth_fixes,
        );
        let n = self.fixes.used().len();
        let spread_m = placing.spread_m;
        let delay = placing.delay;
        let (solution, origin) = match placing.placed {
            Some(solution) => (solution, self.fixes.origin()),
            None => (self.solve_without_fixes(&odom_from_submap)?, None),
        };
        let header = header(&solution, self.graph.up_directions.len(), origin);
        let rows = self.rows(&solution);
        let fixes = FixUse { n, n_used: header.n_fixes as usize, spread_m, delay };
        let summary = summary(&header, &fixes, &rows);
        Some(Placed { header, rows, fixes, shape: placing.shape, steps: None, summary })
    }

    fn rows(&self, solution: &Solution) -> Vec<PlacementRow> {
        let rows = self.nodes.iter().zip(&solution.poses).zip(&solution.covariances).enumerate();
        let row = |(submap, ((node, pose), covariance)): (usize, ((&Node, &Pose), &Matrix6<f64>))| {
            let sigma = |axis: usize| covariance[(axis, axis)].max(0.0).sqrt() as f32;
            PlacementRow {
                submap: submap as u64,
                stamp: node.stamp,
                world_from_submap: (*pose).into(),
                odom_from_submap: node.odom_from_submap.into(),
                sigma_m: [sigma(0), sigma(1), sigma(2)],
                sigma_rad: [sigma(3), sigma(4), sigma(5)],
            }
        };
        rows.map(row).collect()
    }

    fn solve_without_fixes(&self, odom_from_submap: &[Pose]) -> Option<Solution> {
        let is_upright = !self.graph.up_directions.is_empty();
        let gauge = if is_upright { Gauge::FirstPositionAndHeading } else { Gauge::FirstPose };
        let first = self.graph.solve(odom_from_submap, gauge)?;
        self.graph.solve_from(&first.poses, Start::Aligned, gauge)
    }
}

/// A submap of the drive.
pub(crate) struct NumberedSubmap {
    pub number: usize,
    pub odom_from_submap: Pose,
}

/// The latest submap that began at or before a stamp.
fn submap_at(nodes: &[Node], stamp: i64) -> Option<NumberedSubmap> {
    let number = nodes.partition_point(|node| node.stamp <= stamp).checked_sub(1)?;
    Some(NumberedSubmap { number, odom_from_submap: nodes[number].odom_from_submap })
}

fn header(solution: &Solution, n_uprights: usize, origin: Option<Geodetic>) -> PlacementHeader {
    let split = |weights: &[f64]| {
        let n_inliers = Solution::n_inliers(weights);
        (n_inliers as u32, (weights.len() - n_inliers) as u32)
    };
    let (n_loops, n_loops_refused) = split(&solution.loop_weights);
    let (n_fixes, n_fixes_refused) = split(&solution.position_weights);
    let coordinate = |of: fn(&Geodetic) -> f64| origin.as_ref().map_or(0.0, of);
    PlacementHeader {
        latitude_deg: coordinate(|origin| origin.latitude_deg),
        longitude_deg: coordinate(|origin| origin.longitude_deg),
        altitude_m: coordinate(|origin| origin.altitude_m),
        frame: if origin.is_some() { FRAME_EAST_NORTH_UP } else { FRAME_LOCAL },
        n_loops,
        n_loops_refused,
        n_fixes,
        n_fixes_refused,
        n_uprights: n_uprights as u32,
    }
}

fn summary(header: &PlacementHeader, fixes: &FixUse, rows: &[PlacementRow]) -> String {
    let PlacementHeader { n_loops, n_loops_refused, n_fixes: n_used, n_fixes_refused, .. } = header;
    let loops = format!("{n_loops} loop closures ({n_loops_refused} rejected)");
    if header.frame == FRAME_EAST_NORTH_UP {
        let largest = rows.iter().map(PlacementRow::deviation).fold(PoseDeviation::default(), PoseDeviation::max);
        let PoseDeviation { position_m, height_m, heading_deg } = largest;
        return format!(
            "world frame: east-north-up from {n_used} fixes ({n_fixes_refused} rejected), {loops}; largest standard deviation of a \
             submap: position {position_m:.2} m, height {height_m:.2} m, heading {heading_deg:.2} degrees{}",
            delay_text(fixes.delay.as_ref())
        );
    }
    let reason = fixes.reason();
    format!("world frame: local, origin and heading of the vehicle at the first shot ({reason}), {loops}")
}

fn delay_text(delay: Option<&ReceiverDelay>) -> String {
    delay.filter(|delay| !delay.is_out_of_range()).map_or_else(String::new, |ReceiverDelay { late_s, sigma_s }| {
        let seconds = late_s.abs();
        let side = if *late_s > 0.0 { "late" } else { "early" };
        format!("; stamps of the receiver are {seconds:.3} s {side} (standard deviation {sigma_s:.3} s), corrected")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(is_used: bool) -> GeoreferenceSettings {
        GeoreferenceSettings {
            gnss: is_used,
            imu: is_used,
            loops: false,
            unsmooth_fixes: false,
            antenna_in_body: Point3::origin(),
            imu_in_body: Point3::origin(),
            origin: None,
            max_keyframes: 10,
        }
    }

    /// Size of the state in bytes after ticks of 0.1 s with 100 inertial samples and a fix each, without any sweep.
    fn state_bytes(n_ticks: i64, settings: &GeoreferenceSettings) -> usize {
        let mut georeferencer = Georeferencer::new(settings);
        for tick in 0..n_ticks {
            let sample = |k: i64| ImuRow { stamp: (tick * 100 + k) * 1_000_000, ..ImuRow::default() };
            georeferencer.add_imu(&(0..100).map(sample).collect::<Vec<_>>(), settings);
            let fix = GnssRow { stamp: tick * 100_000_000, quality: 1, latitude_deg: 48.0, ..GnssRow::default() };
            assert_eq!(georeferencer.add_gnss(&[fix], settings), 1);
            georeferencer.update(settings);
        }
        postcard::to_stdvec(&georeferencer).expect("encodes").len()
    }

    #[test]
    fn measurements_that_are_not_used_are_not_kept() {
        let unused = settings(false);
        assert_eq!(state_bytes(2000, &unused), state_bytes(0, &unused));
    }

    #[test]
    fn measurements_without_sweeps_are_bounded() {
        let used = settings(true);
        // Ten minutes, and twenty.
        let some = state_bytes(6000, &used);
        let more = state_bytes(12_000, &used);
        assert!(more <= some + some / 10, "{some} bytes became {more}");
        assert!(more < 4 << 20, "{more} bytes");
    }
}
