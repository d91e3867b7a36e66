//! The HDL-32E: 32 lasers that turn ten times a second and fire in a fixed order.
//!
//! Timing and layout follow the HDL-32E user manual: every 46.08 µs all lasers fire once, 1.152 µs apart; 12 such rounds
//! fill a packet. Ranges count 2 mm. The vehicle moves while the head turns, and every round is cast from where the head is
//! then (it moves less than 0.5 mm within a round).

use crate::material::{Material, Properties};
use crate::motion::Motion;
use crate::random::{gauss, hash, unit};
use crate::scene::{Scene, SceneHit, Snapshot};
use crate::trace::{Ray, Vec3};
use geometry::{Isometry3, Pose, Stamp};
use messages::ClassId;

/// Lasers.
pub const N_LASERS: usize = 32;
/// Rounds of firings in a packet.
pub const N_BLOCKS: usize = 12;
/// Between two rounds, ns.
pub const BLOCK_NANOS: i64 = 46_080;
/// Between two firings, ns.
const FIRING_NANOS: i64 = 1_152;
/// Revolutions per second.
const TURNS_PER_SECOND: f64 = 10.0;
/// Longest range, m.
const MAX_RANGE_M: f32 = 100.0;
/// Shortest range, m.
const MIN_RANGE_M: f32 = 0.9;
/// Standard deviation of the range, m (the maker's "accuracy ±2 cm, one sigma").
pub const RANGE_SIGMA_M: f32 = 0.02;
/// One count of the range, m.
const RANGE_UNIT_M: f32 = 0.002;
/// Wavelength, nm.
const LASER_NM: f32 = 903.0;
/// A surface that reflects a tenth is just seen at 90 m if it is met at right angles (the maker states 80 to 100 m).
const LIMIT_REFLECTANCE: f32 = 0.1;
/// See [`LIMIT_REFLECTANCE`].
const LIMIT_RANGE_M: f32 = 90.0;

/// One round of firings, lasers in firing order.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Encoder angle at its first firing, 0.01 deg, 0 to 35999.
    pub azimuth: u16,
    /// What came back.
    pub returns: [Option<LidarReturn>; N_LASERS],
}

/// One return.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LidarReturn {
    /// Range in units of 2 mm, never zero.
    pub range_2mm: u16,
    /// 0 to 100 for what scatters, above for retroreflectors.
    pub intensity: u8,
    /// Truth.
    pub class: ClassId,
    /// Truth.
    pub instance: u16,
}

/// The sensor on its way through the scene.
#[derive(Debug)]
pub struct Lidar<'a> {
    scene: &'a Scene,
    motion: &'a Motion,
    body_from_lidar: Pose,
    seed: u64,
    step: u32,
    materials: Vec<(Properties, f32)>,
}

impl<'a> Lidar<'a> {
    /// `step` of 3 leaves two of three rounds without returns.
    pub fn new(scene: &'a Scene, motion: &'a Motion, body_from_lidar: Pose, seed: u64, step: u32) -> Self {
        let materials = Material::ALL
            .iter()
            .map(|material| {
                let properties = material.properties();
                let reflectance = properties.spectrum.at(LASER_NM);
                (properties, reflectance)
            })
            .collect();
        Self { scene, motion, body_from_lidar, seed, step: step.max(1), materials }
    }

    /// Packets that cover `seconds` to the end of the revolution.
    pub fn n_packets(seconds: f64) -> u64 {
        let turns = (seconds * TURNS_PER_SECOND).ceil();
        (turns / TURNS_PER_SECOND * 1e9 / (BLOCK_NANOS * N_BLOCKS as i64) as f64).ceil() as u64
    }

    /// Time of a packet's first firing.
    pub fn packet_stamp(&self, packet: u64) -> Stamp {
        self.motion.begin.plus_nanos(packet as i64 * BLOCK_NANOS * N_BLOCKS as i64)
    }

    /// The rounds of one packet.
    pub fn packet(&self, packet: u64) -> [Block; N_BLOCKS] {
        std::array::from_fn(|i| self.block(packet * N_BLOCKS as u64 + i as u64))
    }

    fn block(&self, number: u64) -> Block {
        let begin = number as f64 * BLOCK_NANOS as f64 * 1e-9;
        let turns = (begin * TURNS_PER_SECOND).fract();
        // The encoder counts down to 0.01 deg; what is left is the sensor's own error.
        let azimuth = (turns * 36_000.0).floor() as u16 % 36_000;
        if !number.is_multiple_of(u64::from(self.step)) {
            return Block { azimuth, returns: [None; N_LASERS] };
        }
        let middle = begin + 0.5 * (N_LASERS as i64 * FIRING_NANOS) as f64 * 1e-9;
        let snapshot = self.scene.at(middle);
        let world_from_lidar: Isometry3<f32> = (self.motion.pose(middle) * self.body_from_lidar).cast();
        let turn_of = |laser: usize| turns + laser as f64 * FIRING_NANOS as f64 * 1e-9 * TURNS_PER_SECOND;
        let returns = std::array::from_fn(|laser| {
            let direction = direction((turn_of(laser) * std::f64::consts::TAU) as f32, elevation(laser));
            let seed = hash(self.seed, number * N_LASERS as u64 + laser as u64);
            let origin = world_from_lidar.translation.vector;
            self.fire(&snapshot, &Ray { origin, direction: world_from_lidar.rotation * direction, seed })
        });
        Block { azimuth, returns }
    }

    fn fire(&self, snapshot: &Snapshot, ray: &Ray) -> Option<LidarReturn> {
        let hit = self.scene.cast(snapshot, ray, MAX_RANGE_M)?;
        let intensity = self.intensity(ray, &hit)?;
        let range_m = hit.range_m + RANGE_SIGMA_M * gauss(hash(ray.seed, 1));
        (MIN_RANGE_M..MAX_RANGE_M).contains(&range_m).then(|| LidarReturn {
            range_2mm: (range_m / RANGE_UNIT_M).round() as u16,
            intensity,
            class: hit.surface.class,
            instance: hit.surface.instance,
        })
    }

    /// What the receiver makes of a hit; `None` if too little comes back.
    fn intensity(&self, ray: &Ray, hit: &SceneHit) -> Option<u8> {
        let (properties, reflectance) = &self.materials[hit.surface.material as usize];
        if unit(hash(ray.seed, 2)) < properties.beam_loss {
            return None;
        }
        let incidence = -hit.normal.dot(&ray.direction);
        let scattered = reflectance * properties.texture(&hit.texture_point, &hit.normal) * incidence;
        // Foil sends light back whence it came, up to about 60 degrees from its normal.
        let foil = properties.retroreflection * ((incidence - 0.3) / 0.7).max(0.0);
        let received = (scattered + foil) * (LIMIT_RANGE_M / hit.range_m).powi(2);
        // The weakest returns are lost or kept by chance.
        if received < LIMIT_REFLECTANCE * (0.8 + 0.4 * unit(hash(ray.seed, 3))) {
            return None;
        }
        // The device corrects for the range, a little short of it far away.
        let kept = 1.0 - 0.25 * hit.range_m / MAX_RANGE_M;
        let level = 100.0 * scattered * kept + 155.0 * foil + 2.0 * gauss(hash(ray.seed, 4));
        Some(level.round().clamp(1.0, 255.0) as u8)
    }
}

/// Elevation of a laser by its place in the firing order, rad: two interleaved halves, from -30.67 and from -9.33 deg up in
/// steps of 4/3 deg.
pub fn elevation(laser: usize) -> f32 {
    let steps = (laser / 2) as f32 * 4.0 / 3.0;
    (steps + if laser.is_multiple_of(2) { -92.0 / 3.0 } else { -28.0 / 3.0 }).to_radians()
}

/// Where a laser looks in the lidar frame: azimuth 0 along x, 90 degrees to the right, along -y (`formats::velodyne`).
fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    let (sin_a, cos_a) = azimuth.sin_cos();
    let (sin_e, cos_e) = elevation.sin_cos();
    Vec3::new(cos_e * cos_a, -cos_e * sin_a, sin_e)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lasers_fire_in_the_order_of_the_manual() {
        let degrees: Vec<f32> = [0, 1, 2, 3, 30, 31].map(|l| elevation(l).to_degrees()).to_vec();
        for (a, b) in degrees.iter().zip([-30.67, -9.33, -29.33, -8.0, -10.67, 10.67]) {
            assert!((a - b).abs() < 0.005, "{a} {b}");
        }
    }

    #[test]
    fn packets_cover_whole_revolutions() {
        // One revolution is 2170.1 rounds, that is 180.8 packets.
        assert_eq!(Lidar::n_packets(0.1), 181);
        assert_eq!(Lidar::n_packets(0.11), 362);
        assert_eq!(Lidar::n_packets(1.0), 1809);
    }
}
