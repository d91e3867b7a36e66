//! The submap that is being written.

use crate::sweeps::{Cloud, Scene};
use geometry::{Pose, UnitQuaternion, Vector3};
use messages::{
    MAX_SWEEPS_PER_SUBMAP, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, Submap, SubmapHeader, SubmapPoint, SubmapSweep,
    SweepPoint,
};
use rayon::prelude::*;
use registration::{DeskewTable, Registered, Sweep};
use stage::{Loan, Outputs, StepError};

/// A submap under construction: its rows lie in the slot from which consumers will read them.
pub(crate) struct OpenSubmap {
    pub loan: Loan<Submap>,
    pub frame: SubmapFrame,
    pub header: Box<SubmapHeader>,
}

/// What decides when a submap is full.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct SubmapFrame {
    pub world_from_submap: Pose,
    /// Path of the body since the first shot, m.
    pub travelled_m: f64,
    /// Where the body was last, world, m.
    pub body: Vector3<f64>,
}

impl OpenSubmap {
    /// Begins at the place and heading of the body.
    pub fn new(loan: Loan<Submap>, world_from_body: &Pose, n_rings: u32) -> Self {
        let world_from_submap = Pose::from_parts(world_from_body.translation, heading(&world_from_body.rotation));
        let mut header = Box::new(SubmapHeader::default());
        header.world_from_submap = world_from_submap.into();
        header.n_rings = n_rings;
        let body = world_from_body.translation.vector;
        Self { loan, frame: SubmapFrame { world_from_submap, travelled_m: 0.0, body }, header }
    }
    /// Whether a sweep of `n_points` has room.
    pub fn fits(&self, n_points: usize) -> bool {
        (self.header.n_sweeps as usize) < MAX_SWEEPS_PER_SUBMAP
            && n_points <= self.loan.capacity() - self.loan.rows().len()
    }
    /// From the first to the last shot, s.
    pub fn seconds(&self) -> f64 {
        (self.header.stamp_end - self.header.stamp_begin) as f64 * 1e-9
    }
    /// Appends the points of a sweep that are kept, in order. `body` is the position of the body at the last shot, world.
    /// The caller has asked [`OpenSubmap::fits`].
    pub fn append(
        &mut self,
        cloud: &Cloud,
        scene: &Scene,
        registered: &Registered,
        body: Vector3<f64>,
    ) -> Result<(), StepError> {
        let submap_from_world = self.frame.world_from_submap.inverse();
        let (begin, end) = (submap_from_world * registered.begin(), submap_from_world * registered.end());
        let table = DeskewTable::new(&begin, &end, registered.duration_nanos);
        let first_point = self.loan.rows().len() as u32;
        let sweep_idx = self.header.n_sweeps as u16;
        let (capacity, n_kept) = (self.loan.capacity(), scene.kept.len());
        let rows = self.loan.grow(n_kept).ok_or_else(|| {
            StepError::data(format!(
                "sweep {}: {n_kept} points do not fit into a submap of {capacity}: raise submap_points_max",
                cloud.received.seq(),
            ))
        })?;
        let (raw, sweep, moving) = (cloud.received.rows(), &cloud.sweep, &registered.moving);
        let fill = |(rows, kept): (&mut [SubmapPoint], &[usize])| {
            let mut bounds = NO_BOUNDS;
            // Both lists rise.
            let first = kept.first().map_or(0, |first| moving.partition_point(|&idx| (idx as usize) < *first));
            let mut moving = moving[first..].iter().map(|&idx| idx as usize).peekable();
            for (row, &point_idx) in rows.iter_mut().zip(kept) {
                let incidence = scene.incidences[point_idx];
                *row = submap_point(&raw[point_idx], sweep, point_idx, &table, sweep_idx, incidence);
                while moving.next_if(|&idx| idx < point_idx).is_some() {}
                row.flags = if moving.next_if_eq(&point_idx).is_some() { POINT_DYNAMIC } else { 0 };
                bounds = joined(bounds, [[row.x, row.y, row.z]; 2]);
            }
            bounds
        };
        let pieces = rows.par_chunks_mut(PIECE).zip(scene.kept.par_chunks(PIECE));
        let bounds = pieces.map(fill).reduce(|| NO_BOUNDS, joined);
        let before = if first_point == 0 { NO_BOUNDS } else { [self.header.min, self.header.max] };
        [self.header.min, self.header.max] = joined(before, bounds);
        self.header.sweeps[usize::from(sweep_idx)] = SubmapSweep {
            stamp: registered.stamp.0,
            seq: cloud.received.seq(),
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
        self.frame.travelled_m += (body - self.frame.body).norm();
        self.frame.body = body;
        Ok(())
    }
    /// Hands the submap to its consumers.
    pub fn publish(mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        if self.loan.rows().is_empty() {
            // Bounds of nothing would be infinite.
            (self.header.min, self.header.max) = ([0.0; 3], [0.0; 3]);
        }
        let stamp = self.header.stamp_begin;
        *self.loan.header_mut() = *self.header;
        outputs.publish(self.loan, stamp)
    }
}

/// Points that a thread writes at a time.
const PIECE: usize = 1 << 12;
/// Smallest and largest x y z of no points.
const NO_BOUNDS: [[f32; 3]; 2] = [[f32::MAX; 3], [f32::MIN; 3]];

fn joined(a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    // Not `f32::min`, which takes several times as long for the sake of NaN.
    let least = |axis: usize| if b[0][axis] < a[0][axis] { b[0][axis] } else { a[0][axis] };
    let most = |axis: usize| if b[1][axis] > a[1][axis] { b[1][axis] } else { a[1][axis] };
    [std::array::from_fn(least), std::array::from_fn(most)]
}

/// The part of a rotation that turns about z.
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

/// `value.round()` for values of at most 2^23, without the call of a function that processors before SSE 4.1 need.
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
