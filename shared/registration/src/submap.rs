//! Registered sweeps as rows of a submap.

use crate::{DeskewTable, KeptPoints, RawSweep, Registered, Sweep};
use geometry::{Pose, Vector3, heading};
use messages::{
    MAX_SWEEPS_PER_SUBMAP, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, SubmapHeader, SubmapPoint, SubmapSweep, SweepPoint,
    pose_numbers,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Points of one parallel task.
const PIECE: usize = 1 << 12;
/// Smallest and largest x y z of an empty set.
const NO_BOUNDS: [[f32; 3]; 2] = [[f32::MAX; 3], [f32::MIN; 3]];

/// Pose of a submap, and the path so far, by which it is full.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubmapFrame {
    /// Position and heading of the body at the first shot.
    pub world_from_submap: Pose,
    /// Path length of the body since the first shot, m.
    pub path_m: f64,
    /// Last position of the body, world, m.
    pub body: Vector3<f64>,
}

/// A submap that is being filled, without the memory of its rows.
#[derive(Clone, Debug)]
pub struct OpenSubmap {
    /// Its pose.
    pub frame: SubmapFrame,
    /// Its header so far.
    pub header: Box<SubmapHeader>,
}

/// The points that a sweep adds to a submap.
#[derive(Clone, Copy, Debug)]
pub struct SweepRows<'a> {
    /// All points as they were received.
    pub raw: RawSweep<'a>,
    /// The same points.
    pub sweep: &'a Sweep,
    /// Those to add.
    pub kept: &'a KeptPoints,
}

impl OpenSubmap {
    /// Begins at the position and heading of the body of a vehicle with `n_lidars`.
    pub fn new(world_from_body: &Pose, n_lidars: u32) -> Self {
        let world_from_submap = Pose::from_parts(world_from_body.translation, heading(&world_from_body.rotation));
        let mut header = Box::new(SubmapHeader::default());
        header.world_from_submap = world_from_submap.into();
        header.n_lidars = n_lidars;
        let body = world_from_body.translation.vector;
        Self { frame: SubmapFrame { world_from_submap, path_m: 0.0, body }, header }
    }
    /// Whether the sweep table has room for more sweeps.
    pub fn has_room(&self, n_more: usize) -> bool {
        self.header.n_sweeps as usize + n_more <= MAX_SWEEPS_PER_SUBMAP
    }
    /// From the first to the last shot, s.
    pub fn seconds(&self) -> f64 {
        (self.header.stamp_end - self.header.stamp_begin) as f64 * 1e-9
    }
    /// Writes the kept points of a sweep to `rows`, which are as many and follow `first_point` others. `body` is the position of the
    /// body at the last shot, world. The caller has checked [`OpenSubmap::has_room`].
    pub fn append(
        &mut self,
        rows: &mut [SubmapPoint],
        first_point: u32,
        points: SweepRows<'_>,
        registered: &Registered,
        body: Vector3<f64>,
    ) {
        let submap_from_world = self.frame.world_from_submap.inverse();
        let (begin, end) = (submap_from_world * registered.begin(), submap_from_world * registered.end());
        let table = DeskewTable::new(&begin, &end, registered.duration_nanos);
        let sweep_idx = self.header.n_sweeps as u16;
        let SweepRows { raw: RawSweep { seq, header, rows: raw, .. }, sweep, kept } = points;
        let (lidar, n_rings) = (header.lidar, header.n_rings);
        let (moving, n_points) = (&registered.moving, rows.len() as u32);
        let fill = |(rows, indices): (&mut [SubmapPoint], &[usize])| {
            let mut bounds = NO_BOUNDS;
            // Both lists are ascending.
            let first = indices.first().map_or(0, |first| moving.partition_point(|&idx| (idx as usize) < *first));
            let mut moving = moving[first..].iter().map(|&idx| idx as usize).peekable();
            for (row, &point_idx) in rows.iter_mut().zip(indices) {
                let incidence = kept.incidences[point_idx];
                *row = submap_point(&raw[point_idx], sweep, point_idx, &table, sweep_idx, incidence);
                while moving.next_if(|&idx| idx < point_idx).is_some() {}
                row.flags = if moving.next_if_eq(&point_idx).is_some() { POINT_DYNAMIC } else { 0 };
                bounds = joined(bounds, [[row.x, row.y, row.z]; 2]);
            }
            bounds
        };
        let pieces = rows.par_chunks_mut(PIECE).zip(kept.indices.par_chunks(PIECE));
        let bounds = pieces.map(fill).reduce(|| NO_BOUNDS, joined);
        let before = if first_point == 0 { NO_BOUNDS } else { [self.header.min, self.header.max] };
        [self.header.min, self.header.max] = joined(before, bounds);
        self.header.sweeps[usize::from(sweep_idx)] = SubmapSweep {
            stamp: registered.stamp.0,
            seq,
            duration_nanos: registered.duration_nanos,
            first_point,
            n_points,
            lidar,
            submap_from_lidar_begin: pose_numbers(&begin),
            submap_from_lidar_end: pose_numbers(&end),
        };
        if sweep_idx == 0 {
            self.header.stamp_begin = registered.stamp.0;
        }
        let end = registered.end_stamp().0;
        match (lidar as usize).checked_sub(1).and_then(|other| self.header.n_rings_of_others.get_mut(other)) {
            Some(of_lidar) => *of_lidar = n_rings,
            None => self.header.n_rings = n_rings,
        }
        // The last shot of another LiDAR may be earlier or later than that of the first.
        self.header.stamp_end = if lidar == 0 { end } else { end.max(self.header.stamp_end) };
        self.header.n_sweeps += 1;
        self.frame.path_m += (body - self.frame.body).norm();
        self.frame.body = body;
    }
    /// The header of a submap with `n_points` that is complete.
    pub fn finished(mut self, n_points: usize) -> SubmapHeader {
        if n_points == 0 {
            // The bounds of an empty submap would be infinite.
            (self.header.min, self.header.max) = ([0.0; 3], [0.0; 3]);
        }
        *self.header
    }
}

fn joined(a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    // Not `f32::min`, which is several times slower because it handles NaN.
    let min = |axis: usize| if b[0][axis] < a[0][axis] { b[0][axis] } else { a[0][axis] };
    let max = |axis: usize| if b[1][axis] > a[1][axis] { b[1][axis] } else { a[1][axis] };
    [std::array::from_fn(min), std::array::from_fn(max)]
}

fn submap_point(
    raw: &SweepPoint,
    sweep: &Sweep,
    point_idx: usize,
    table: &DeskewTable,
    sweep_idx: u16,
    incidence: f32,
) -> SubmapPoint {
    let timed = &sweep.points()[point_idx];
    let [x, y, z] = table.deskew(timed.position, timed.offset_nanos);
    let elevation_deg = sweep.elevation(point_idx).to_degrees();
    SubmapPoint {
        x,
        y,
        z,
        offset_nanos: timed.offset_nanos,
        azimuth: raw.azimuth,
        elevation: rounded(elevation_deg * 100.0) as i16,
        sweep_idx,
        intensity: raw.intensity,
        ring: raw.ring,
        incidence: if incidence.is_nan() { POINT_INCIDENCE_UNKNOWN } else { rounded(incidence * 254.0) as u8 },
        flags: 0,
        reserved: 0,
    }
}

/// `value.round()` for values of at most 2^23, without the function call that processors before SSE 4.1 need.
#[inline]
fn rounded(value: f32) -> i32 {
    let towards_zero = value as i32;
    let rest = value - towards_zero as f32;
    towards_zero + i32::from(rest >= 0.5) - i32::from(rest <= -0.5)
}
