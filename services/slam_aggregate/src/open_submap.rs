//! The submap that is being filled.

use crate::incoming::{IncomingSweep, KeptPoints};
use geometry::{Pose, UnitQuaternion, Vector3};
use messages::{
    MAX_SWEEPS_PER_SUBMAP, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, SubmapHeader, SubmapPoint, SubmapSweep, SubmapTopic,
    SweepPoint,
};
use rayon::prelude::*;
use registration::{DeskewTable, Registered, Sweep};
use stage::{Loan, Outputs, StepError};

/// A submap under construction. Its rows are in the loan from which consumers will read them.
pub(crate) struct OpenSubmap {
    pub loan: Loan<SubmapTopic>,
    pub frame: SubmapFrame,
    pub header: Box<SubmapHeader>,
}

/// Pose of a submap, and the path so far, by which it is full.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct SubmapFrame {
    pub world_from_submap: Pose,
    /// Path length of the body since the first shot, m.
    pub path_m: f64,
    /// Last position of the body, world, m.
    pub body: Vector3<f64>,
}

impl OpenSubmap {
    /// Begins at the position and heading of the body.
    pub fn new(loan: Loan<SubmapTopic>, world_from_body: &Pose, n_rings: u32) -> Self {
        let world_from_submap = Pose::from_parts(world_from_body.translation, heading(&world_from_body.rotation));
        let mut header = Box::new(SubmapHeader::default());
        header.world_from_submap = world_from_submap.into();
        header.n_rings = n_rings;
        let body = world_from_body.translation.vector;
        Self { loan, frame: SubmapFrame { world_from_submap, path_m: 0.0, body }, header }
    }
    /// Whether a sweep of `n_points` fits.
    pub fn fits(&self, n_points: usize) -> bool {
        (self.header.n_sweeps as usize) < MAX_SWEEPS_PER_SUBMAP
            && n_points <= self.loan.capacity() - self.loan.rows().len()
    }
    /// From the first to the last shot, s.
    pub fn seconds(&self) -> f64 {
        (self.header.stamp_end - self.header.stamp_begin) as f64 * 1e-9
    }
    /// Appends the kept points of a sweep in order. `body` is the position of the body at the last shot, world. The caller has
    /// checked [`OpenSubmap::fits`].
    pub fn append(
        &mut self,
        incoming: &IncomingSweep,
        kept: &KeptPoints,
        registered: &Registered,
        body: Vector3<f64>,
    ) -> Result<(), StepError> {
        let submap_from_world = self.frame.world_from_submap.inverse();
        let (begin, end) = (submap_from_world * registered.begin(), submap_from_world * registered.end());
        let table = DeskewTable::new(&begin, &end, registered.duration_nanos);
        let first_point = self.loan.rows().len() as u32;
        let sweep_idx = self.header.n_sweeps as u16;
        let (capacity, n_kept) = (self.loan.capacity(), kept.indices.len());
        let rows = self.loan.grow(n_kept).map_err(|_full| {
            StepError::data(format!(
                "sweep {}: {n_kept} points exceed a submap of {capacity}; increase submap_points_max",
                incoming.received.seq(),
            ))
        })?;
        let (raw, sweep, moving) = (incoming.received.rows(), &incoming.sweep, &registered.moving);
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
            seq: incoming.received.seq(),
            duration_nanos: registered.duration_nanos,
            first_point,
            n_points: n_kept as u32,
            reserved: 0,
            submap_from_lidar_begin: pose_numbers(&begin),
            submap_from_lidar_end: pose_numbers(&end),
        };
        if sweep_idx == 0 {
            self.header.stamp_begin = registered.stamp.0;
        }
        self.header.stamp_end = registered.stamp.0 + i64::from(registered.duration_nanos);
        self.header.n_sweeps += 1;
        self.frame.path_m += (body - self.frame.body).norm();
        self.frame.body = body;
        Ok(())
    }
    /// Publishes the submap.
    pub fn publish(mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        if self.loan.rows().is_empty() {
            // The bounds of an empty submap would be infinite.
            (self.header.min, self.header.max) = ([0.0; 3], [0.0; 3]);
        }
        let stamp = self.header.stamp_begin;
        *self.loan.header_mut() = *self.header;
        outputs.publish(self.loan, stamp)
    }
}

/// Points of one parallel task.
const PIECE: usize = 1 << 12;
/// Smallest and largest x y z of an empty set.
const NO_BOUNDS: [[f32; 3]; 2] = [[f32::MAX; 3], [f32::MIN; 3]];

fn joined(a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    // Not `f32::min`, which is several times slower because it handles NaN.
    let min = |axis: usize| if b[0][axis] < a[0][axis] { b[0][axis] } else { a[0][axis] };
    let max = |axis: usize| if b[1][axis] > a[1][axis] { b[1][axis] } else { a[1][axis] };
    [std::array::from_fn(min), std::array::from_fn(max)]
}

/// The rotation about z that has the same forward direction.
fn heading(rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let forward = rotation * Vector3::x();
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward.y.atan2(forward.x))
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

/// x y z, qx qy qz qw.
fn pose_numbers(pose: &Pose) -> [f32; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|value| value as f32)
}
