//! Collects the measurements of a drive and places its submaps at the end.

use crate::drift::Drift;
use crate::fixes::Fixes;
use crate::gravity::Gravity;
use crate::receiver_errors::correct_positions;
use crate::recent_path::RecentPath;
use crate::{Gauge, Keyframe, LoopFinder, PoseGraph, RelativePose, Solution, align_odometry};
use geometry::{Geodetic, Isometry3, Point3, Pose};
use messages::{FRAME_EAST_NORTH_UP, FRAME_LOCAL, GnssRow, ImuRow, PlacementHeader, PlacementRow};
use nalgebra::Matrix6;
use registration::{LocalMap, Registered};
use serde::{Deserialize, Serialize};

/// A submap gets a keyframe only after this path since the last one, m: a vehicle that stands sees nothing new.
const KEYFRAME_M: f64 = 5.0;
/// Positions determine north if their root mean square distance from their center is at least this, m: as on 35 m of straight
/// road. An error of one metre then rotates the result by some degrees, and the covariances say so.
const MIN_SPREAD_M: f64 = 10.0;

/// Which measurements are used, and where the sensors are.
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
    /// m.
    pub antenna_in_body: Point3<f64>,
    /// m.
    pub imu_in_body: Point3<f64>,
    /// Origin of the world, if the drive names one.
    pub origin: Option<Geodetic>,
}

/// A submap by the odometry.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Node {
    odom_from_submap: Pose,
    stamp: i64,
}

/// The measurements so far: some hundred bytes a submap, and 70 kB a keyframe. Serializing it saves the state.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Georeferencer {
    nodes: Vec<Node>,
    graph: PoseGraph,
    drift: Drift,
    path: RecentPath,
    fixes: Fixes,
    gravity: Gravity,
    path_m: f64,
    keyframes: Vec<Keyframe>,
}

/// Where the submaps lie.
pub struct Placed {
    /// Frame of the world, and numbers of measurements used and rejected.
    pub header: PlacementHeader,
    /// One for each submap.
    pub rows: Vec<PlacementRow>,
    /// One line for the operator.
    pub summary: String,
}

impl Georeferencer {
    /// Without measurements.
    pub fn new(settings: &GeoreferenceSettings) -> Self {
        Self { fixes: Fixes::with_origin(settings.origin), ..Self::default() }
    }

    /// Adds fixes in the order of time. Returns how many of them have a valid position.
    pub fn add_gnss(&mut self, rows: &[GnssRow]) -> usize {
        rows.iter().filter(|row| self.fixes.push(row)).count()
    }

    /// Adds inertial samples in the order of time.
    pub fn add_imu(&mut self, rows: &[ImuRow]) {
        for row in rows {
            self.gravity.push(row);
        }
    }

    /// Begins a submap; the next sweep is its first one.
    pub fn begin_submap(&mut self, odom_from_submap: Pose, stamp: i64) {
        let source = self.nodes.len();
        if let Some(before) = self.nodes.last() {
            self.graph.odometry.push(RelativePose {
                target: source - 1,
                source,
                target_from_source: before.odom_from_submap.inv_mul(&odom_from_submap),
                information: self.drift.information(&before.odom_from_submap),
            });
        }
        self.drift = Drift::default();
        self.nodes.push(Node { odom_from_submap, stamp });
    }

    /// Adds a sweep to the open submap. `begin` and `end` are `odom_from_body` at its first and last shot.
    pub fn add_sweep(&mut self, registered: &Registered, begin: &Pose, end: &Pose) {
        let begin_stamp = registered.stamp.0;
        let end_stamp = begin_stamp + i64::from(registered.duration_nanos);
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

    /// Ends the open submap and searches loop closures. `map` is the current map of the odometry. Returns whether a loop was
    /// closed.
    pub fn end_submap(&mut self, settings: &GeoreferenceSettings, map: &LocalMap) -> bool {
        let (Some(node), Some(stamp)) = (self.nodes.last(), self.path.last()) else { return false };
        let Some(odom_from_body) = self.path.at(stamp).filter(|_| settings.loops) else { return false };
        let last_path_m = self.keyframes.last().map_or(f64::NEG_INFINITY, |last| last.path_m);
        if self.path_m - last_path_m < KEYFRAME_M {
            return false;
        }
        let number = self.nodes.len() - 1;
        let keyframe = Keyframe::new(number, self.path_m, &map.points(), &node.odom_from_submap, &odom_from_body);
        let closure = LoopFinder::default().find(&keyframe, &self.keyframes);
        self.keyframes.push(keyframe);
        let is_closed = closure.is_some();
        self.graph.loops.extend(closure.map(|closure| closure.relative));
        is_closed
    }

    /// Turns the sensor data up to the last sweep into measurements of submaps.
    pub fn update(&mut self, settings: &GeoreferenceSettings) {
        let Self { nodes, graph, path, fixes, gravity, .. } = self;
        let submap_at = |stamp: i64| submap_at(nodes, stamp);
        if settings.gnss {
            fixes.update(path, &settings.antenna_in_body, submap_at, &mut graph.positions);
        }
        if settings.imu {
            gravity.update(path, &settings.imu_in_body, submap_at, &mut graph.up_directions);
        }
    }

    /// Places all submaps by all measurements, at the end of the drive. `None` without submaps.
    pub fn solve(&mut self, settings: &GeoreferenceSettings) -> Option<Placed> {
        let Self { nodes, graph, path, gravity, .. } = self;
        gravity.close(path, &settings.imu_in_body, |stamp| submap_at(nodes, stamp), &mut graph.up_directions);
        if self.nodes.is_empty() {
            return None;
        }
        let alignment = align_odometry(&self.fixes.point_pairs(&self.graph.positions));
        let spread_m = alignment.map_or(0.0, |alignment| alignment.spread_m);
        let aligned = alignment.filter(|alignment| alignment.spread_m >= MIN_SPREAD_M);
        let origin = self.fixes.origin().filter(|_| aligned.is_some());
        let world_from_odom = aligned.map_or_else(Isometry3::identity, |alignment| alignment.world_from_odom);
        let gauge = match (aligned, self.graph.up_directions.is_empty()) {
            (Some(_), _) => Gauge::Positions,
            (None, false) => Gauge::FirstPositionAndHeading,
            (None, true) => Gauge::FirstPose,
        };
        let mut graph = self.graph.clone();
        if aligned.is_none() {
            graph.positions.clear();
        }
        let start: Vec<Pose> = self.nodes.iter().map(|node| world_from_odom * node.odom_from_submap).collect();
        // The errors of the fixes only show against placed submaps.
        let first = graph.solve(&start, gauge)?;
        correct_positions(self.fixes.used(), &mut graph.positions, &first.poses, settings.unsmooth_fixes);
        let solution = graph.solve(&first.poses, gauge)?;
        let header = header(&solution, &graph, origin);
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
        let summary = summary(&header, self.graph.positions.len(), spread_m);
        Some(Placed { header, rows: rows.map(row).collect(), summary })
    }
}

/// Number and pose of the submap that began last at a stamp.
fn submap_at(nodes: &[Node], stamp: i64) -> Option<(usize, Pose)> {
    let number = nodes.partition_point(|node| node.stamp <= stamp).checked_sub(1)?;
    Some((number, nodes[number].odom_from_submap))
}

fn header(solution: &Solution, graph: &PoseGraph, origin: Option<Geodetic>) -> PlacementHeader {
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
        n_uprights: graph.up_directions.len() as u32,
    }
}

fn summary(header: &PlacementHeader, n_fixes: usize, spread_m: f64) -> String {
    let PlacementHeader { n_loops, n_loops_refused, n_fixes: n_used, n_fixes_refused, .. } = header;
    let loops = format!("{n_loops} loop closures ({n_loops_refused} rejected)");
    if header.frame == FRAME_EAST_NORTH_UP {
        return format!("world frame: east-north-up from {n_used} fixes ({n_fixes_refused} rejected), {loops}");
    }
    let reason = match n_fixes {
        0 => "no fixes".to_owned(),
        n => format!("{n} fixes have a spread of {spread_m:.1} m, {MIN_SPREAD_M} m are needed to find north"),
    };
    format!("world frame: local, origin and heading of the vehicle at the first shot ({reason}), {loops}")
}
