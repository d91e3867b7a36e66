//! Drives through simulated towns.

use crate::error::TownSweepsError;
use crate::mount::Mount;
use crate::source::Source;
use crate::submap::TownSubmap;
use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapSweep, pose_numbers};
use random::Random;
use simulation::{DriveSpec, Simulation, Town};

/// A simulated drive.
#[derive(Clone, Debug)]
pub struct TownDrive {
    /// Kind of town.
    pub town: Town,
    /// Seed of town and drive.
    pub seed: u64,
    /// Length of the drive, s.
    pub seconds: f64,
}

impl TownDrive {
    /// The town and the motion through it.
    pub fn simulation(&self) -> Result<Simulation, TownSweepsError> {
        let spec = DriveSpec { town: self.town, ..DriveSpec::urban(self.seed, self.seconds) };
        Simulation::new(&spec).map_err(|cause| TownSweepsError::Town { seed: self.seed, cause })
    }

    /// `n` submaps of `n_sweeps` sweeps each, evenly distributed over the drive. Consecutive sweeps are `stride` revolutions apart.
    pub fn submaps(
        &self,
        n: usize,
        n_sweeps: usize,
        stride: u64,
        mount: Mount,
    ) -> Result<Vec<TownSubmap>, TownSweepsError> {
        self.submaps_in(&self.simulation()?, n, n_sweeps, stride, mount)
    }

    /// Submaps as from [`Self::submaps`], in the result of [`Self::simulation`].
    pub fn submaps_in(
        &self,
        simulation: &Simulation,
        n: usize,
        n_sweeps: usize,
        stride: u64,
        mount: Mount,
    ) -> Result<Vec<TownSubmap>, TownSweepsError> {
        let n_turns = (self.seconds * 10.0).floor() as u64;
        let span = n_sweeps as u64 * stride;
        if span > n_turns {
            return Err(TownSweepsError::TooShort { n_sweeps, stride, seconds: self.seconds });
        }
        let first = |i: usize| (n_turns - span) * i as u64 / (n.max(2) - 1) as u64;
        Ok((0..n).map(|i| self.submap(simulation, first(i), n_sweeps, stride, i, mount)).collect())
    }

    fn submap(
        &self,
        simulation: &Simulation,
        first_turn: u64,
        n_sweeps: usize,
        stride: u64,
        index: usize,
        mount: Mount,
    ) -> TownSubmap {
        let mut random = Random::for_stream(self.seed, index as u64);
        let mounted = mount.lidar(&mut random);
        let body_from_lidar = mounted.body_from_lidar;
        let source = Source::new(simulation, &mounted, self.seed ^ (index as u64) << 32);
        let begin = source.begin_of(first_turn);
        let submap_from_world = simulation.motion.pose_at(begin).inverse();
        let pose_at =
            |nanos: i64| submap_from_world * simulation.motion.pose_at(begin.plus_nanos(nanos)) * body_from_lidar;
        let mut submap = TownSubmap { header: Box::default(), points: Vec::new(), truth: Vec::new() };
        // A lidar without rings reports 0.
        submap.header.n_rings = if mounted.has_rings { source.n_rings() as u32 } else { 0 };
        for sweep in 0..n_sweeps.min(MAX_SWEEPS_PER_SUBMAP) {
            let turn = first_turn + sweep as u64 * stride;
            let stamp = source.begin_of(turn);
            let since_begin = stamp.0 - begin.0;
            let duration_nanos = source.turn_nanos();
            let first_point = submap.points.len();
            submap.push_turn(&source.turn(turn), sweep, &mut random, |nanos| pose_at(since_begin + nanos));
            submap.header.sweeps[sweep] = SubmapSweep {
                stamp: stamp.0,
                seq: turn,
                duration_nanos,
                first_point: first_point as u32,
                n_points: (submap.points.len() - first_point) as u32,
                lidar: 0,
                submap_from_lidar_begin: pose_numbers(&pose_at(since_begin)),
                submap_from_lidar_end: pose_numbers(&pose_at(since_begin + i64::from(duration_nanos))),
            };
        }
        submap.header.n_sweeps = n_sweeps as u32;
        submap
    }
}
