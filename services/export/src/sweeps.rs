//! Where the lidar was when it measured a point.

use geometry::{Point3, Pose, Vector3};
use messages::{SubmapHeader, SubmapPoint, SubmapSweep};
use stage::StepError;

/// Everything that turns a submap's points into the world's.
pub(crate) struct Placement {
    world_from_submap: Pose,
    sweeps: Vec<SweepPath>,
}

/// One sweep: the lidar moves on a line from its first to its last shot.
pub(crate) struct SweepPath {
    begin: Vector3<f64>,
    /// World, m per ns.
    velocity: Vector3<f64>,
    stamp: i64,
    /// Number of the sweep in the drive.
    pub(crate) seq: i32,
}

impl Placement {
    /// Checks what the header says; `seq` is for messages.
    pub(crate) fn new(header: &SubmapHeader, seq: u64) -> Result<Self, StepError> {
        let fault = |rule: String| StepError::data(format!("submap {seq}: {rule}"));
        let world_from_submap = header
            .world_from_submap
            .to_pose()
            .ok_or_else(|| fault(format!("world_from_submap {:?} is no rigid transform", header.world_from_submap)))?;
        let sweeps = header
            .sweeps
            .get(..header.n_sweeps as usize)
            .ok_or_else(|| fault(format!("{} sweeps, at most {} may be", header.n_sweeps, header.sweeps.len())))?;
        let path = |sweep: &SubmapSweep| SweepPath::new(sweep, &world_from_submap).map_err(fault);
        Ok(Self { sweeps: sweeps.iter().map(path).collect::<Result<_, _>>()?, world_from_submap })
    }

    /// `point` in the world frame.
    #[inline]
    pub(crate) fn position(&self, point: &SubmapPoint) -> Point3<f64> {
        self.world_from_submap * Point3::new(f64::from(point.x), f64::from(point.y), f64::from(point.z))
    }

    /// The sweep of `point`, which [`Placement::check`] has seen.
    #[inline]
    pub(crate) fn sweep(&self, point: &SubmapPoint) -> &SweepPath {
        &self.sweeps[usize::from(point.sweep_idx)]
    }

    /// Whether every point belongs to a sweep of the header.
    pub(crate) fn check(&self, points: &[SubmapPoint], seq: u64) -> Result<(), StepError> {
        match points.iter().position(|point| usize::from(point.sweep_idx) >= self.sweeps.len()) {
            None => Ok(()),
            Some(index) => Err(StepError::data(format!(
                "submap {seq}: point {index} is of sweep {}, the header has {}",
                points[index].sweep_idx,
                self.sweeps.len()
            ))),
        }
    }
}

impl SweepPath {
    fn new(sweep: &SubmapSweep, world_from_submap: &Pose) -> Result<Self, String> {
        let position = |pose: &[f32; 7]| {
            let p = Point3::new(f64::from(pose[0]), f64::from(pose[1]), f64::from(pose[2]));
            (world_from_submap * p).coords
        };
        let begin = position(&sweep.submap_from_lidar_begin);
        let moved = position(&sweep.submap_from_lidar_end) - begin;
        // A sweep of one shot has no duration and does not move.
        let velocity = moved / f64::from(sweep.duration_nanos.max(1));
        let seq = i32::try_from(sweep.seq).map_err(|_| format!("sweep number {} does not fit an int", sweep.seq))?;
        Ok(Self { begin, velocity, stamp: sweep.stamp, seq })
    }

    /// Position of the lidar in the world when it measured the point.
    #[inline]
    pub(crate) fn lidar_position(&self, offset_nanos: u32) -> Vector3<f64> {
        self.begin + self.velocity * f64::from(offset_nanos)
    }

    /// Seconds since the Unix epoch; f64 resolves 0.24 µs there, a fifth of the time between two shots.
    #[inline]
    pub(crate) fn time_s(&self, offset_nanos: u32) -> f64 {
        let nanos = self.stamp.saturating_add(i64::from(offset_nanos));
        nanos.div_euclid(1_000_000_000) as f64 + nanos.rem_euclid(1_000_000_000) as f64 * 1e-9
    }
}
