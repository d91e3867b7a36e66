//! An exposure: poses of the camera and of all movers at instants while the shutter is open.

use crate::motion::Motion;
use geometry::{Pose, Stamp};
use random::hash;
use raytrace::{Ray, Vec3};
use town::{Scene, Snapshot};

/// Instants per exposure: 3 cm apart at 100 ms and 10 m/s.
pub const N_INSTANTS: usize = 36;

/// An exposure of one camera.
#[derive(Debug)]
pub struct Exposure<'a> {
    /// The town.
    pub scene: &'a Scene,
    instants: Vec<(Snapshot, nalgebra::Isometry3<f32>)>,
    seed: u64,
}

impl<'a> Exposure<'a> {
    /// An exposure around the stamp of its middle.
    pub fn new(
        scene: &'a Scene,
        motion: &Motion,
        body_from_camera: &Pose,
        middle: Stamp,
        exposure_nanos: u64,
        seed: u64,
    ) -> Self {
        let instant = |i: usize| {
            let share = (i as f64 + 0.5) / N_INSTANTS as f64 - 0.5;
            let seconds = middle.seconds_since(motion.begin) + share * exposure_nanos as f64 * 1e-9;
            (scene.at(seconds), (motion.pose(seconds) * body_from_camera).cast())
        };
        Self { scene, instants: (0..N_INSTANTS).map(instant).collect(), seed }
    }

    /// Poses of the movers at an instant, 0 to [`N_INSTANTS`] - 1.
    pub fn snapshot(&self, instant: usize) -> &Snapshot {
        &self.instants[instant].0
    }

    /// The ray from the camera at an instant along a direction in its frame; `sample` selects its random numbers.
    pub fn ray(&self, instant: usize, direction: &Vec3, sample: u64) -> Ray {
        let world_from_camera = &self.instants[instant].1;
        let origin = world_from_camera.translation.vector;
        Ray { origin, direction: world_from_camera.rotation * direction, seed: hash(self.seed, sample) }
    }
}

/// The instant in the middle of the exposure.
pub const MIDDLE: usize = N_INSTANTS / 2;

/// The instant in stratum `k` of `n` (at most [`N_INSTANTS`]) of the exposure, at random within it.
pub const fn stratified(k: usize, n: usize, random: u64) -> usize {
    let width = N_INSTANTS / n;
    k % n * width + (random % width as u64) as usize
}
