//! Registered sweeps as rows of a submap.

pub(crate) mod body_poses;
pub(crate) mod kept_points;
pub(crate) mod raw_sweep;

use crate::{DeskewTable, KeptPoints, RawSweep, Registered, Sweep, TimedPoint};
use geometry::{Pose, Vector3, heading};
use lidar::fast_atan2;
use messages::{
    MAX_SWEEPS_PER_SUBMAP, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, SubmapHeader, SubmapPoint, SubmapSweep, SweepPoint,
    pose_numbers,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Points of one parallel task.
const PIECE: usize = 1 << 12;
/// Points whose angles are computed at once.
const BLOCK: usize = 64;
/// Smallest and largest x y z of an empty set.
const NO_BOUNDS: [[f32; 3]; 2] = [[f32::MAX; 3], [f32::MIN; 3]];

/// Pose of a submap in odom, and its path length so far, which decides when it is full.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubmapFrame {
    /// Position and heading of the body at the first shot, without its tilt relative to odom, m.
    pub odom_from_submap: Pose,
    /// Path length of the body since the first shot, m.
    pub path_m: f64,
    /// Last position of the body in odom, m.
    pub body: Vector3<f64>,
}

/// A submap that is being filled, without its rows.
#[derive(Clone, Debug)]
pub struct OpenSubmap {
    /// Pose and path length.
    pub frame: SubmapFrame,
    /// Header so far.
    pub header: Box<SubmapHeader>,
}

/// The points that a sweep adds to a submap.
#[derive(Clone, Copy, Debug)]
pub struct SweepRows<'a> {
    /// All points as they were received.
    pub raw: RawSweep<'a>,
    /// All points, prepared for the odometry.
    pub sweep: &'a Sweep,
    /// The points to add.
    pub kept: &'a KeptPoints,
}

impl OpenSubmap {
    /// Starts a submap at the position and heading of the body of a vehicle with `n_lidars` LiDARs.
    pub fn new(odom_from_body: &Pose, n_lidars: u32) -> Self {
        let odom_from_submap = Pose::from_parts(odom_from_body.translation, heading(&odom_from_body.rotation));
        let mut header = Box::new(SubmapHeader::default());
        header.odom_from_submap = odom_from_submap.into();
        header.n_lidars = n_lidars;
        let body = odom_from_body.translation.vector;
        Self { frame: SubmapFrame { odom_from_submap, path_m: 0.0, body }, header }
    }
    /// Whether the sweep table has room for more sweeps.
    pub fn has_room(&self, n_more: usize) -> bool {
        self.header.n_sweeps as usize + n_more <= MAX_SWEEPS_PER_SUBMAP
    }
    /// Time from the first to the last shot, s.
    pub fn seconds(&self) -> f64 {
        (self.header.stamp_end - self.header.stamp_begin) as f64 * 1e-9
    }
    /// Writes the kept points of a sweep to `rows`. `rows` has exactly their number and follows `first_point` other
    /// rows. `body` is the position of the body at the last shot in odom, m. The caller has checked
    /// [`OpenSubmap::has_room`].
    pub fn append(
        &mut self,
        rows: &mut [SubmapPoint],
        first_point: u32,
        points: SweepRows<'_>,
        registered: &Registered,
        body: Vector3<f64>,
    ) {
        let submap_from_odom = self.frame.odom_from_submap.inverse();
        let begin = submap_from_odom * registered.begin();
        let end = submap_from_odom * registered.end();
        let table = if registered.is_given() {
            let poses: Vec<Pose> = registered.path.iter().map(|pose| submap_from_odom * pose).collect();
            DeskewTable::along(&poses, registered.duration_nanos)
        } else {
            DeskewTable::new(&begin, &end, registered.duration_nanos)
        };
        let sweep_idx = self.header.n_sweeps as u16;
        let SweepRows { raw: RawSweep { seq, header, rows: raw, .. }, sweep, kept } = points;
        let lidar = header.lidar;
        let n_rings = header.n_rings;
        let moving = &registered.moving;
        let n_points = rows.len() as u32;
        let fill = |(rows, indices): (&mut [SubmapPoint], &[usize])| {
            let mut bounds = NO_BOUNDS;
            // Both lists are ascending.
            let first = indices.first().map_or(0, |first| moving.partition_point(|&idx| (idx as usize) < *first));
            let mut moving = moving[first..].iter().map(|&idx| idx as usize).peekable();
            for (rows, indices) in rows.chunks_mut(BLOCK).zip(indices.chunks(BLOCK)) {
                let angles = Angles::new(sweep, &kept.incidences, indices);
                for (number, (row, &point_idx)) in rows.iter_mut().zip(indices).enumerate() {
                    *row = submap_point(&raw[point_idx], &sweep.points()[point_idx], &table, sweep_idx);
                    row.elevation = angles.elevations[number];
                    row.incidence = angles.incidences[number];
                    while moving.next_if(|&idx| idx < point_idx).is_some() {}
                    row.flags = if moving.next_if_eq(&point_idx).is_some() { POINT_DYNAMIC } else { 0 };
                    bounds = joined(bounds, [[row.x, row.y, row.z]; 2]);
                }
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
        // The last shot of another LiDAR may be earlier or later than the last shot of the first.
        self.header.stamp_end = if lidar == 0 { end } else { end.max(self.header.stamp_end) };
        self.header.n_sweeps += 1;
        self.frame.path_m += (body - self.frame.body).norm();
        self.frame.body = body;
    }
    /// The header of a complete submap with `n_points` points.
    pub fn finished(mut self, n_points: usize) -> SubmapHeader {
        if n_points == 0 {
            // The bounds of an empty submap would be infinite.
            self.header.min = [0.0; 3];
            self.header.max = [0.0; 3];
        }
        *self.header
    }
}

fn joined(a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    // `f32::min` is several times slower because it handles NaN.
    let min = |axis: usize| if b[0][axis] < a[0][axis] { b[0][axis] } else { a[0][axis] };
    let max = |axis: usize| if b[1][axis] > a[1][axis] { b[1][axis] } else { a[1][axis] };
    [std::array::from_fn(min), std::array::from_fn(max)]
}

/// A row without its angles.
#[inline]
fn submap_point(raw: &SweepPoint, timed: &TimedPoint, table: &DeskewTable, sweep_idx: u16) -> SubmapPoint {
    let [x, y, z] = table.deskew(timed.position, timed.offset_nanos);
    SubmapPoint {
        x,
        y,
        z,
        offset_nanos: timed.offset_nanos,
        azimuth: raw.azimuth,
        elevation: 0,
        sweep_idx,
        intensity: raw.intensity,
        ring: raw.ring,
        incidence: POINT_INCIDENCE_UNKNOWN,
        flags: 0,
        reserved: 0,
    }
}

/// Angles of points as a submap stores them.
struct Angles {
    elevations: [i16; BLOCK],
    incidences: [u8; BLOCK],
}

impl Angles {
    /// Computes the angles of at most [`BLOCK`] finite points: elevation above the LiDAR's horizontal plane within 2e-5
    /// rad, and incidence.
    fn new(sweep: &Sweep, incidences: &[f32], indices: &[usize]) -> Self {
        let mut slopes = [[0.0; BLOCK]; 2];
        let mut cosines = [f32::NAN; BLOCK];
        for (number, &point_idx) in indices.iter().enumerate() {
            let [x, y, z] = sweep.points()[point_idx].position;
            (slopes[0][number], slopes[1][number]) = (z, x * x + y * y);
            cosines[number] = incidences[point_idx];
        }
        wide_loops::run(
            #[inline(always)]
            || Self::rounded(&slopes, &cosines),
        )
    }
    #[inline(always)]
    fn rounded([heights, squares]: &[[f32; BLOCK]; 2], cosines: &[f32; BLOCK]) -> Self {
        let mut angles = Self { elevations: [0; BLOCK], incidences: [POINT_INCIDENCE_UNKNOWN; BLOCK] };
        for at in 0..BLOCK {
            let elevation_deg = fast_atan2(heights[at], squares[at].sqrt()).to_degrees();
            angles.elevations[at] = rounded(elevation_deg * 100.0) as i16;
        }
        for (incidence, &cosine) in angles.incidences.iter_mut().zip(cosines) {
            let is_known = cosine >= 0.0;
            let steps = rounded(if is_known { cosine * 254.0 } else { 0.0 }) as u8;
            *incidence = if is_known { steps } else { POINT_INCIDENCE_UNKNOWN };
        }
        angles
    }
}

/// Computes `value.round()` for values of at most 2^22. A loop over conversions to an integer does not vectorize,
/// because they check the limits.
#[inline(always)]
fn rounded(value: f32) -> i32 {
    /// From here to twice this value, f32 holds whole numbers only: the last bits of a sum are the added number.
    const WHOLE: f32 = (1 << 23) as f32;
    let size = value.abs();
    let nearest = size + WHOLE;
    // Ties go to the even number; `round` rounds them away from zero.
    let is_half_below = size - (nearest - WHOLE) == 0.5;
    let whole = (nearest.to_bits() - WHOLE.to_bits()) as i32 + i32::from(is_half_below);
    if value < 0.0 { -whole } else { whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_equals_round() {
        let mut random = random::Random::new(7);
        let halves = (-20_000..20_000).map(|n| n as f32 * 0.5);
        let others = (0..20_000).map(|_| random.range(-9000.0, 9000.0));
        let near_halves = (0..2000).flat_map(|n| [(n as f32 + 0.5).next_up(), (n as f32 + 0.5).next_down()]);
        for value in halves.chain(others).chain(near_halves) {
            assert_eq!(rounded(value), value.round() as i32, "{value}");
        }
    }

    #[test]
    fn angles_of_a_block_equal_those_of_each_point() {
        let mut random = random::Random::new(8);
        let mut point = || {
            let position = [random.range(-50.0, 50.0), random.range(-50.0, 50.0), random.range(-9.0, 20.0)];
            TimedPoint { position, offset_nanos: 0, ring: 0 }
        };
        let sweep = Sweep::new(geometry::Stamp(0), (0..200).map(|_| point()).collect(), 0);
        let incidences: Vec<f32> =
            (0..200_u8).map(|n| if n % 7 == 0 { f32::NAN } else { f32::from(n) / 199.0 }).collect();
        let indices: Vec<usize> = (0..200).step_by(3).take(BLOCK).collect();
        let angles = Angles::new(&sweep, &incidences, &indices);
        for (number, &point_idx) in indices.iter().enumerate() {
            let [x, y, z] = sweep.points()[point_idx].position;
            let elevation = (fast_atan2(z, (x * x + y * y).sqrt()).to_degrees() * 100.0).round() as i16;
            let cosine = incidences[point_idx];
            let incidence = if cosine.is_nan() { POINT_INCIDENCE_UNKNOWN } else { (cosine * 254.0).round() as u8 };
            assert_eq!((angles.elevations[number], angles.incidences[number]), (elevation, incidence));
        }
    }
}
