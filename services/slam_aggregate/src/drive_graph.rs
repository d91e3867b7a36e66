//! The submaps of the drive, what ties them together, and where they lie in the end.

use crate::drift::Drift;
use crate::fixes::Fixes;
use crate::gravity::Gravity;
use crate::receiver_errors::unsmooth_or_doubt;
use crate::recent_path::RecentPath;
use geometry::{Geodetic, Isometry3, Point3, Pose};
use messages::{FRAME_EAST_NORTH_UP, FRAME_LOCAL, GnssRow, ImuRow, PlacementHeader, PlacementRow};
use nalgebra::Matrix6;
use pose_graph::{Gauge, Keyframe, LoopFinder, PoseGraph, Relative, Solution, first_guess};
use registration::{LocalMap, Registered};
use serde::{Deserialize, Serialize};

/// Submaps with less way than this since the last keyframe get none, m: a vehicle that stands sees nothing new.
const KEYFRAME_M: f64 = 5.0;
/// Positions say which way is north if they lie this far from their center, root mean square, m: as on 35 m of straight road.
/// An error of a metre then turns the whole by some degrees, which the covariances tell.
const LEAST_SPREAD_M: f64 = 10.0;

/// What is measured, and where.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sensors {
    /// Fixes are used.
    pub gnss: bool,
    /// Gravity is used.
    pub imu: bool,
    /// Places are looked for.
    pub loops: bool,
    /// m.
    pub antenna_in_body: Point3<f64>,
    /// Where acceleration is felt, m.
    pub imu_in_body: Point3<f64>,
    /// Zero of the world, if the drive names one.
    pub origin: Option<Geodetic>,
}

/// A submap as the odometry placed it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Node {
    odom_from_submap: Pose,
    stamp: i64,
}

/// Part of the stage's state: some hundred bytes a submap, and 70 kB a keyframe.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct DriveGraph {
    nodes: Vec<Node>,
    graph: PoseGraph,
    drift: Drift,
    path: RecentPath,
    fixes: Fixes,
    gravity: Gravity,
    way_m: f64,
    keyframes: Vec<Keyframe>,
}

/// Where everything lies.
pub(crate) struct Placed {
    pub header: PlacementHeader,
    pub rows: Vec<PlacementRow>,
    /// For the operator.
    pub words: String,
}

impl DriveGraph {
    pub fn new(sensors: &Sensors) -> Self {
        Self { fixes: Fixes::with_origin(sensors.origin), ..Self::default() }
    }

    pub fn push_fixes(&mut self, rows: &[GnssRow]) -> usize {
        rows.iter().filter(|row| self.fixes.push(row)).count()
    }

    pub fn push_inertial(&mut self, rows: &[ImuRow]) {
        for row in rows {
            self.gravity.push(row);
        }
    }

    /// A submap begins with the sweep that comes next.
    pub fn begin_submap(&mut self, odom_from_submap: Pose, stamp: i64) {
        let source = self.nodes.len();
        if let Some(before) = self.nodes.last() {
            self.graph.odometry.push(Relative {
                target: source - 1,
                source,
                target_from_source: before.odom_from_submap.inv_mul(&odom_from_submap),
                information: self.drift.information(&before.odom_from_submap),
            });
        }
        self.drift = Drift::default();
        self.nodes.push(Node { odom_from_submap, stamp });
    }

    /// A sweep of the submap that began last: `odom_from_body` at its first and last shot.
    pub fn add_sweep(&mut self, registered: &Registered, begin: &Pose, end: &Pose) {
        let begin_stamp = registered.stamp.0;
        let end_stamp = begin_stamp + i64::from(registered.duration_nanos);
        // Sweeps follow upon each other without gaps, but for lost packets.
        let since = self.path.last().and_then(|last| self.path.at(last));
        let way_m = since.map_or(0.0, |last| (last.translation.vector - end.translation.vector).norm());
        self.way_m += way_m;
        self.drift.add(registered, way_m);
        for (stamp, pose) in [(begin_stamp, begin), (end_stamp, end)] {
            if self.path.last().is_none_or(|last| last < stamp) {
                self.path.push(stamp, *pose);
            }
        }
    }

    /// The submap that began last is complete; `map` is the odometry's now. Says whether a place was seen again.
    pub fn end_submap(&mut self, sensors: &Sensors, map: &LocalMap) -> bool {
        let (Some(node), Some(stamp)) = (self.nodes.last(), self.path.last()) else { return false };
        let Some(odom_from_body) = self.path.at(stamp).filter(|_| sensors.loops) else { return false };
        let last_way_m = self.keyframes.last().map_or(f64::NEG_INFINITY, |last| last.way_m);
        if self.way_m - last_way_m < KEYFRAME_M {
            return false;
        }
        let number = self.nodes.len() - 1;
        let keyframe = Keyframe::new(number, self.way_m, &map.points(), &node.odom_from_submap, &odom_from_body);
        let closed = LoopFinder::default().find(&keyframe, &self.keyframes);
        self.keyframes.push(keyframe);
        let is_closed = closed.is_some();
        self.graph.loops.extend(closed.map(|closed| closed.relative));
        is_closed
    }

    /// Turns what other sensors measured up to the last sweep into measurements of submaps.
    pub fn settle(&mut self, sensors: &Sensors) {
        let Self { nodes, graph, path, fixes, gravity, .. } = self;
        let submap_at = |stamp: i64| submap_at(nodes, stamp);
        if sensors.gnss {
            fixes.settle(path, &sensors.antenna_in_body, submap_at, &mut graph.positions);
        }
        if sensors.imu {
            gravity.settle(path, &sensors.imu_in_body, submap_at, &mut graph.uprights);
        }
    }

    /// Everything has been seen: where are the submaps? `None` without submaps.
    pub fn place(&mut self, sensors: &Sensors) -> Option<Placed> {
        let Self { nodes, graph, path, gravity, .. } = self;
        gravity.close(path, &sensors.imu_in_body, |stamp| submap_at(nodes, stamp), &mut graph.uprights);
        if self.nodes.is_empty() {
            return None;
        }
        let alignment = first_guess(&self.fixes.sightings(&self.graph.positions));
        let spread_m = alignment.map_or(0.0, |alignment| alignment.spread_m);
        let aligned = alignment.filter(|alignment| alignment.spread_m >= LEAST_SPREAD_M);
        let origin = self.fixes.origin().filter(|_| aligned.is_some());
        let world_from_odom = aligned.map_or_else(Isometry3::identity, |alignment| alignment.world_from_odom);
        let gauge = match (aligned, self.graph.uprights.is_empty()) {
            (Some(_), _) => Gauge::Positions,
            (None, false) => Gauge::FirstPlaceAndHeading,
            (None, true) => Gauge::FirstPose,
        };
        let mut graph = self.graph.clone();
        if aligned.is_none() {
            graph.positions.clear();
        }
        let start: Vec<Pose> = self.nodes.iter().map(|node| world_from_odom * node.odom_from_submap).collect();
        // Only with the submaps in place is it known how fixes move.
        let first = graph.solve(&start, gauge)?;
        unsmooth_or_doubt(self.fixes.settled(), &mut graph.positions, &first.poses);
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
        let words = words(&header, self.graph.positions.len(), spread_m);
        Some(Placed { header, rows: rows.map(row).collect(), words })
    }
}

/// Number and place of the submap that had begun last at a stamp.
fn submap_at(nodes: &[Node], stamp: i64) -> Option<(usize, Pose)> {
    let number = nodes.partition_point(|node| node.stamp <= stamp).checked_sub(1)?;
    Some((number, nodes[number].odom_from_submap))
}

fn header(solution: &Solution, graph: &PoseGraph, origin: Option<Geodetic>) -> PlacementHeader {
    let split = |weights: &[f64]| {
        let n_believed = Solution::n_believed(weights);
        (n_believed as u32, (weights.len() - n_believed) as u32)
    };
    let (n_loops, n_loops_refused) = split(&solution.loop_weights);
    let (n_fixes, n_fixes_refused) = split(&solution.position_weights);
    let place = |of: fn(&Geodetic) -> f64| origin.as_ref().map_or(0.0, of);
    PlacementHeader {
        latitude_deg: place(|origin| origin.latitude_deg),
        longitude_deg: place(|origin| origin.longitude_deg),
        altitude_m: place(|origin| origin.altitude_m),
        frame: if origin.is_some() { FRAME_EAST_NORTH_UP } else { FRAME_LOCAL },
        n_loops,
        n_loops_refused,
        n_fixes,
        n_fixes_refused,
        n_uprights: graph.uprights.len() as u32,
    }
}

fn words(header: &PlacementHeader, n_fixes: usize, spread_m: f64) -> String {
    let PlacementHeader { n_loops, n_loops_refused, n_fixes: n_used, n_fixes_refused, .. } = header;
    let loops = format!("{n_loops} closed loops ({n_loops_refused} refused)");
    if header.frame == FRAME_EAST_NORTH_UP {
        return format!("the world is east-north-up by {n_used} fixes ({n_fixes_refused} refused), {loops}");
    }
    let why = match n_fixes {
        0 => "there are no fixes".to_owned(),
        n => format!("{n} fixes within {spread_m:.1} m do not say where north is, {LEAST_SPREAD_M} m do"),
    };
    format!("the world is the vehicle's place and heading at the first shot: {why}; {loops}")
}
