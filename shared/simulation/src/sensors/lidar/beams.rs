//! Origins and directions of the beams.

use super::errors::LaserError;
use super::model::{LidarModel, N_SLOTS, Slot, slots};
use lidar::velodyne::Model;
use nalgebra::{Isometry3, Point3};
use raytrace::{Ray, Vec3};

/// Beams of a model, by slot of a packet.
#[derive(Clone, Debug)]
pub struct Beams {
    /// The slots.
    pub slots: Vec<Slot>,
    /// The slots in the order of tracing: ring by ring in alternating direction, so that consecutive rays are coherent.
    pub order: Vec<usize>,
    lasers: Vec<Laser>,
    turns_per_nano: f64,
    carries_angle: bool,
}

#[derive(Clone, Copy, Debug)]
struct Laser {
    sin_elevation: f32,
    cos_elevation: f32,
    /// Azimuth offset, to the left of the encoder angle, rad.
    left: f64,
    /// Origin of the beam: ahead of the axis, left of it, above the origin, m.
    start: [f32; 3],
}

/// One beam.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    /// Center ray.
    pub ray: Ray,
    /// Unit vector across the beam, clockwise as the head rotates.
    pub right: Vec3,
    /// Unit vector across the beam, towards higher rings.
    pub up: Vec3,
}

impl Beams {
    /// Beams of a model, with the errors of its lasers.
    pub(super) fn new(model: &LidarModel, errors: &[LaserError]) -> Self {
        let lasers = model.model.lasers().iter().zip(errors).map(|(laser, error)| {
            let (sin, cos) = (laser.elevation_deg + error.elevation_deg).to_radians().sin_cos();
            // The vertical offset of an HDL-64E is at right angles to the beam (`lidar::velodyne`).
            let (ahead, up) =
                if model.model == Model::Hdl64e { (-laser.up_m * sin, laser.up_m * cos) } else { (0.0, laser.up_m) };
            Laser {
                sin_elevation: sin as f32,
                cos_elevation: cos as f32,
                left: laser.azimuth_deg.to_radians(),
                start: [ahead as f32, laser.left_m as f32, up as f32],
            }
        });
        let slots = slots(model.model);
        let rings = model.model.rings();
        let mut order: Vec<usize> = (0..N_SLOTS).collect();
        order.sort_by_key(|slot| {
            let Slot { laser, firing_nanos, .. } = slots[*slot];
            let firing_nanos = i64::from(firing_nanos);
            (rings[laser], if rings[laser].is_multiple_of(2) { firing_nanos } else { -firing_nanos })
        });
        Self {
            slots,
            order,
            lasers: lasers.collect(),
            turns_per_nano: model.turns_per_second * 1e-9,
            carries_angle: model.model.carries_azimuth(),
        }
    }

    /// Rotations of the head after `nanos` ns.
    pub fn turns(&self, nanos: i64) -> f64 {
        nanos as f64 * self.turns_per_nano
    }

    /// The beam of a slot of a packet whose first firing is `packet_nanos` after the start.
    pub fn beam(&self, slot: usize, packet_nanos: i64, world_from_lidar: &Isometry3<f32>, seed: u64) -> Beam {
        debug_assert!(slot < N_SLOTS);
        let Slot { laser, block_nanos, firing_nanos, .. } = self.slots[slot];
        let laser = &self.lasers[laser];
        // The corrections of an HDL-64E refer to the angle at the start of the block.
        let nanos = packet_nanos + i64::from(if self.carries_angle { firing_nanos } else { block_nanos });
        let azimuth = self.turns(nanos).fract() * std::f64::consts::TAU - laser.left;
        let sin = azimuth.sin() as f32;
        let cos = azimuth.cos() as f32;
        let sin_e = laser.sin_elevation;
        let cos_e = laser.cos_elevation;
        // Azimuth 0 is along x, 90 degrees to the right, along -y.
        let [ahead, left, up] = laser.start;
        let start = Point3::new(ahead * cos + left * sin, left * cos - ahead * sin, up);
        let turn = |v: Vec3| world_from_lidar.rotation * v;
        Beam {
            ray: Ray {
                origin: (world_from_lidar * start).coords,
                direction: turn(Vec3::new(cos_e * cos, -cos_e * sin, sin_e)),
                seed,
            },
            right: turn(Vec3::new(-sin, -cos, 0.0)),
            up: turn(Vec3::new(-sin_e * cos, sin_e * sin, cos_e)),
        }
    }
}
