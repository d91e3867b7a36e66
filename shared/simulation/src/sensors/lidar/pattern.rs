//! Lidars with firing patterns other than Velodyne packets: a fan of 128 rings, and a non-repetitive pattern.

use super::optics::Optics;
use super::receiver::{N_PARTS, Part, Receiver};
use super::returns::LidarReturn;
use super::{PART_WEIGHT, SIDES};
use crate::motion::Motion;
use geometry::{Isometry3, Pose, Stamp};
use random::hash;
use rayon::prelude::*;
use raytrace::{Ray, Vec3};
use std::f64::consts::TAU;
use std::ops::Range;
use town::Scene;

/// Beam directions of a lidar over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// 128 rings, equally spaced from -22.5 to 22.5 degrees, which fire simultaneously in 1024 columns per turn of 0.1 s.
    /// 865 nm, 90 m for 10 %, from the data sheet of Ouster's OS1-128.
    Rings128,
    /// One beam through two prisms, 240 000 shots a second, field of view of 70.4 by 77.2 degrees around the x axis, 905
    /// nm, from the data sheet of Livox' Avia. The prisms rotate as in the Mid-40, 7294 and -4664 times a minute (Liu,
    /// Wu, Zhang, IEEE/ASME Transactions on Mechatronics 2021), so no sweep repeats another.
    Rosette,
}

/// One shot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Firing {
    /// Time since the start of the drive, ns.
    pub nanos: i64,
    /// Azimuth, clockwise from forward, degrees, 0 to 360.
    pub azimuth_deg: f64,
    /// Elevation, degrees, up positive.
    pub elevation_deg: f64,
    /// Ring, 0 = lowest.
    pub ring: u8,
}

const N_RINGS: i64 = 128;
const N_COLUMNS: i64 = 1024;
const TURN_NANOS: i64 = 100_000_000;
const SHOTS_PER_SECOND: f64 = 240_000.0;
/// Rotations of the prisms per second.
const PRISMS_HZ: [f64; 2] = [7294.0 / 60.0, -4664.0 / 60.0];
/// Width and height of the field of view, degrees.
const FIELD_DEG: [f64; 2] = [70.4, 77.2];

impl Pattern {
    /// Number of rings; 0 for a pattern without rings.
    pub const fn n_rings(self) -> usize {
        match self {
            Self::Rings128 => N_RINGS as usize,
            Self::Rosette => 0,
        }
    }

    /// Beam and receiver.
    pub const fn optics(self) -> Optics {
        match self {
            Self::Rings128 => Optics { range_m: [0.5, 120.0], wavelength_nm: 865.0, ..Optics::HDL32E },
            Self::Rosette => Optics { range_m: [1.0, 130.0], wavelength_nm: 905.0, tenth_m: 120.0, ..Optics::HDL32E },
        }
    }

    /// Shots in a time range, ns since the start of the drive, in order.
    pub fn firings(self, nanos: Range<i64>) -> Vec<Firing> {
        // Number of simultaneous shots, and number of shots per ns.
        let (at_once, per_nano) = match self {
            Self::Rings128 => (N_RINGS, N_COLUMNS as f64 / TURN_NANOS as f64),
            Self::Rosette => (1, SHOTS_PER_SECOND * 1e-9),
        };
        let [first, end] = [nanos.start, nanos.end].map(|nanos| (nanos as f64 * per_nano).ceil() as i64 * at_once);
        (first..end).map(|shot| self.firing(shot)).collect()
    }

    fn firing(self, shot: i64) -> Firing {
        match self {
            Self::Rings128 => {
                let column = shot.div_euclid(N_RINGS);
                let ring = shot.rem_euclid(N_RINGS);
                Firing {
                    nanos: column * TURN_NANOS / N_COLUMNS,
                    azimuth_deg: column.rem_euclid(N_COLUMNS) as f64 * 360.0 / N_COLUMNS as f64,
                    elevation_deg: -22.5 + 45.0 * ring as f64 / (N_RINGS - 1) as f64,
                    ring: ring as u8,
                }
            }
            Self::Rosette => {
                let seconds = shot as f64 / SHOTS_PER_SECOND;
                let [a, b] = PRISMS_HZ.map(|turns| (seconds * turns * TAU).sin_cos());
                Firing {
                    nanos: (seconds * 1e9) as i64,
                    azimuth_deg: (0.25 * FIELD_DEG[0] * (a.1 + b.1)).rem_euclid(360.0),
                    elevation_deg: 0.25 * FIELD_DEG[1] * (a.0 + b.0),
                    ring: 0,
                }
            }
        }
    }
}

/// A shot and its return.
#[derive(Clone, Copy, Debug)]
pub struct FiringReturn {
    /// The shot.
    pub firing: Firing,
    /// Its return.
    pub received: LidarReturn,
}

/// A perfect unit with such a pattern that moves through a scene.
///
/// Each beam is traced by its center and its four sides (see [`super`]). Pose and movers are constant during steps of 0.1
/// ms, evaluated at the middle of the step.
#[derive(Debug)]
pub struct PatternLidar<'a> {
    scene: &'a Scene,
    motion: &'a Motion,
    pattern: Pattern,
    receiver: Receiver,
    body_from_lidar: Pose,
    seed: u64,
}

/// The vehicle moves by less than 2 mm in this time, ns.
const STEP_NANOS: i64 = 100_000;

impl<'a> PatternLidar<'a> {
    /// The lidar at `body_from_lidar`, with noise from `seed`.
    pub fn new(scene: &'a Scene, motion: &'a Motion, pattern: Pattern, body_from_lidar: Pose, seed: u64) -> Self {
        let receiver = Receiver::perfect(pattern.optics(), pattern.n_rings().max(1));
        Self { scene, motion, pattern, receiver, body_from_lidar, seed }
    }

    /// Its pattern.
    pub fn pattern(&self) -> Pattern {
        self.pattern
    }

    /// Time of the first shot of the drive.
    pub fn begin(&self) -> Stamp {
        self.motion.begin
    }

    /// The shots in a time range, ns since the start of the drive, and their returns.
    pub fn sweep(&self, nanos: Range<i64>) -> Vec<FiringReturn> {
        let firings = self.pattern.firings(nanos);
        let steps: Vec<&[Firing]> =
            firings.chunk_by(|a, b| a.nanos.div_euclid(STEP_NANOS) == b.nanos.div_euclid(STEP_NANOS)).collect();
        steps.into_par_iter().flat_map_iter(|step| self.step(step)).collect()
    }

    fn step(&self, firings: &[Firing]) -> Vec<FiringReturn> {
        let Some(first) = firings.first() else { return Vec::new() };
        let seconds = (first.nanos.div_euclid(STEP_NANOS) * STEP_NANOS + STEP_NANOS / 2) as f64 * 1e-9;
        let world_from_lidar: Isometry3<f32> = (self.motion.pose(seconds) * self.body_from_lidar).cast();
        let optics = self.pattern.optics();
        let eye = world_from_lidar.translation.vector;
        let movers = self.scene.movers_near(&eye, optics.range_m[1] + 1.0, seconds);
        let snapshot = self.scene.some_at(&movers, seconds);
        let rays: Vec<Ray> = firings.iter().flat_map(|firing| self.rays(firing, &optics, &world_from_lidar)).collect();
        let hits = self.scene.cast_all(&rays, optics.range_m[1], |_| &snapshot);
        let rays_of_firings = rays.chunks_exact(N_PARTS).zip(hits.chunks_exact(N_PARTS));
        let received = |(firing, (rays, hits)): (&Firing, (&[Ray], &[_]))| {
            let of_ray = |(ray, hit): (&Ray, &Option<_>)| self.receiver.part(PART_WEIGHT, ray, hit.as_ref()?);
            let mut parts: Vec<Part> = rays.iter().zip(hits).filter_map(of_ray).collect();
            let received = self.receiver.strongest(&mut parts, firing.ring.into(), rays[0].seed)?;
            Some(FiringReturn { firing: *firing, received })
        };
        firings.iter().zip(rays_of_firings).filter_map(received).collect()
    }

    /// The center of a beam and its sides.
    fn rays(&self, firing: &Firing, optics: &Optics, world_from_lidar: &Isometry3<f32>) -> [Ray; N_PARTS] {
        let [(sin, cos), (sin_e, cos_e)] =
            [firing.azimuth_deg, firing.elevation_deg].map(|degrees| (degrees as f32).to_radians().sin_cos());
        let turn = |v: Vec3| world_from_lidar.rotation * v;
        let direction = turn(Vec3::new(cos_e * cos, -cos_e * sin, sin_e));
        let right = turn(Vec3::new(-sin, -cos, 0.0));
        let up = turn(Vec3::new(-sin_e * cos, sin_e * sin, cos_e));
        let seed = hash(hash(self.seed, firing.nanos as u64), firing.ring.into());
        std::array::from_fn(|part| {
            let [x, y] = part.checked_sub(1).map_or([0.0, 0.0], |side| SIDES[side]);
            let across = |[width, height]: [f32; 2]| right * (x * width) + up * (y * height);
            Ray {
                origin: world_from_lidar.translation.vector + across(optics.aperture_m),
                direction: (direction + across(optics.divergence)).normalize(),
                seed: if part == 0 { seed } else { hash(seed, 7 + part as u64) },
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_fire_in_columns_of_one_turn() {
        let firings = Pattern::Rings128.firings(0..TURN_NANOS);
        assert_eq!(firings.len(), 128 * 1024);
        assert_eq!((firings[127].ring, firings[127].elevation_deg, firings[128].ring), (127, 22.5, 0));
        assert!(firings[..128].iter().all(|firing| firing.azimuth_deg == 0.0 && firing.nanos == 0));
        // The next turn starts where this one ends.
        let next = Pattern::Rings128.firings(TURN_NANOS..TURN_NANOS + 1);
        assert_eq!((next.len(), next[0].azimuth_deg, next[0].nanos), (128, 0.0, TURN_NANOS));
    }

    #[test]
    fn rosette_fills_its_field_and_does_not_repeat() {
        let [first, second] = [0, 1].map(|turn| Pattern::Rosette.firings(turn * TURN_NANOS..(turn + 1) * TURN_NANOS));
        assert_eq!((first.len(), second.len()), (24_000, 24_000));
        let across = |firing: &Firing| (firing.azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
        for firing in first.iter().chain(&second) {
            assert!(across(firing).abs() <= 35.2 && firing.elevation_deg.abs() <= 38.6, "{firing:?}");
        }
        assert!(first.iter().any(|f| across(f) > 34.0) && first.iter().any(|f| f.elevation_deg < -38.0));
        let cell = |f: &Firing| [across(f), f.elevation_deg].map(|degrees| (degrees / 0.5).floor() as i32);
        let cells = |firings: &[Firing]| firings.iter().map(cell).collect::<std::collections::BTreeSet<_>>();
        let first = cells(&first);
        let second = cells(&second);
        let new = second.difference(&first).count();
        assert!(5 * new > second.len(), "{new} of {}", second.len());
    }
}
