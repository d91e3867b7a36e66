//! Signal of a satellite at the antenna: strength and multipath error.
//!
//! A signal arrives directly if the line of sight is free, attenuated if leaves or edges cover a part of the first
//! Fresnel zone, and by specular reflection at walls. A reflection in addition to the direct signal shifts the
//! correlation peak (Braasch, "Multipath effects", in: Global Positioning System: Theory and Applications, 1996). A
//! reflection without a direct signal is tracked instead and is delayed by the whole detour.

use super::sky::Satellite;
use geometry::Vector3;
use random::hash;
use raytrace::{Ray, Vec3};
use std::f64::consts::TAU;
use town::{Scene, Snapshot};

/// Wavelength of L1 and E1, m.
const WAVE_M: f64 = 0.190_293_67;
/// Maximum distance of obstacles, m.
const REACH_M: f32 = 250.0;
/// Half the opening angle of the cone around the line of sight that approximates the first Fresnel zone, rad: 1 m at 20
/// m, where its radius is 2 m.
const CONE: f64 = 0.05;
/// Number of rays on the cone, in addition to the ray along its axis.
const N_CONE: usize = 6;
/// Strength of an unobstructed signal at the zenith, dB-Hz.
const ZENITH_DBHZ: f64 = 47.0;
/// Loss of antenna gain from the zenith to the horizon, dB.
const HORIZON_LOSS_DB: f64 = 9.0;
/// Amplitude of a reflection by masonry and glass: -9 dB, because the antenna receives the reversed polarization weakly.
const REFLECTED: f64 = 0.35;
/// Half the distance of the correlators, a tenth of a chip of the C/A code, m.
const HALF_CORRELATOR_M: f64 = 14.65;
/// The code is smoothed by the carrier over this time, s.
const SMOOTHING_SECONDS: f64 = 1.0;
/// Two walls are the same if their normals differ by less than 8 degrees and their distances by less than this, m.
const SAME_WALL_M: f64 = 0.5;

/// Surroundings of an antenna, for ray casts.
pub trait Surroundings {
    /// Whether the ray hits anything before `max_m`.
    fn is_blocked(&self, ray: &Ray, max_m: f32) -> bool;
    /// The nearest surface.
    fn nearest(&self, ray: &Ray, max_m: f32) -> Option<SurfaceHit>;
}

/// A surface hit by a ray.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// Range, m.
    pub range_m: f32,
    /// Normal.
    pub normal: Vec3,
}

/// A town at one time.
pub struct TownAtTime<'a> {
    /// The town.
    pub scene: &'a Scene,
    /// Its movers at that time.
    pub snapshot: Snapshot,
}

impl Surroundings for TownAtTime<'_> {
    fn is_blocked(&self, ray: &Ray, max_m: f32) -> bool {
        self.scene.is_blocked(&self.snapshot, ray, max_m)
    }
    fn nearest(&self, ray: &Ray, max_m: f32) -> Option<SurfaceHit> {
        let hit = self.scene.cast(&self.snapshot, ray, max_m)?;
        Some(SurfaceHit { range_m: hit.range_m, normal: hit.normal })
    }
}

/// One received signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Carrier to noise density, dB-Hz.
    pub strength_dbhz: f64,
    /// Range error by multipath, m.
    pub detour_m: f64,
    /// Whether only a reflection is received.
    pub is_reflected: bool,
}

/// A wall near the antenna: unit normal towards it, and its distance along that normal, m.
#[derive(Clone, Copy, Debug)]
pub struct Wall {
    normal: Vector3<f64>,
    distance_m: f64,
}

/// A signal reflected by a wall.
#[derive(Clone, Copy, Debug)]
struct Reflection {
    /// Detour, m.
    late_m: f64,
    /// Mean of the cosine of the carrier phase over the smoothing time, -1 to 1.
    fading: f64,
}

/// An antenna at one time.
pub struct Antenna<'a, S> {
    around: &'a S,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    walls: Vec<Wall>,
    seed: u64,
}

impl<'a, S: Surroundings> Antenna<'a, S> {
    /// An antenna at a position (m) with a velocity (m/s). Searches for walls around it.
    pub fn new(around: &'a S, position: Vector3<f64>, velocity: Vector3<f64>, seed: u64) -> Self {
        let mut antenna = Self { around, position, velocity, walls: Vec::new(), seed };
        // 36 directions at each of three elevations find every facade that is closer than it is high.
        for (tier, elevation) in [0.05_f64, 0.35, 0.7].into_iter().enumerate() {
            for step in 0..36 {
                let azimuth = f64::from(step) * TAU / 36.0;
                let (sin, cos) = elevation.sin_cos();
                let direction = Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
                let ray = antenna.ray(position, direction, 1000 + tier as u64 * 36 + step as u64);
                antenna.add_wall(&ray);
            }
        }
        antenna
    }

    fn add_wall(&mut self, ray: &Ray) {
        let Some(hit) = self.around.nearest(ray, REACH_M) else { return };
        let normal: Vector3<f64> = hit.normal.cast();
        let distance_m = -f64::from(hit.range_m) * normal.dot(&ray.direction.cast());
        // Vertical, and far enough away not to be part of the ego vehicle.
        if normal.z.abs() > 0.2 || distance_m < 0.5 {
            return;
        }
        let same = |w: &Wall| w.normal.dot(&normal) > 0.99 && (w.distance_m - distance_m).abs() < SAME_WALL_M;
        if !self.walls.iter().any(same) {
            self.walls.push(Wall { normal, distance_m });
        }
    }

    /// The signal of a satellite; `None` if no signal arrives.
    pub fn receive(&self, satellite: &Satellite) -> Option<Signal> {
        let to = satellite.direction;
        let free_dbhz = ZENITH_DBHZ - HORIZON_LOSS_DB * (1.0 - to.z);
        let open = self.open_share(satellite);
        let reflections: Vec<Reflection> =
            self.walls.iter().filter_map(|wall| self.reflection(satellite, wall)).collect();
        if open > 0.0 {
            let share = (REFLECTED / open).min(0.9);
            let shift_m = |reflection: &Reflection| peak_shift(reflection.late_m, share, reflection.fading);
            let detour_m = reflections.iter().map(shift_m).sum();
            return Some(Signal { strength_dbhz: free_dbhz + 20.0 * open.log10(), detour_m, is_reflected: false });
        }
        // The earliest reflection is tracked.
        let late_m = reflections.iter().map(|reflection| reflection.late_m).min_by(f64::total_cmp)?;
        let strength_dbhz = free_dbhz + 20.0 * REFLECTED.log10();
        Some(Signal { strength_dbhz, detour_m: late_m, is_reflected: true })
    }

    /// Unobstructed share of the cone around the line of sight.
    fn open_share(&self, satellite: &Satellite) -> f64 {
        let to = satellite.direction;
        let side = to.cross(&if to.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize();
        let other = to.cross(&side);
        let free = |i: usize| {
            let around = i as f64 * TAU / N_CONE as f64;
            let off = if i == N_CONE { Vector3::zeros() } else { side * around.cos() + other * around.sin() };
            let number = (satellite.index * (N_CONE + 1) + i) as u64;
            let ray = self.ray(self.position, (to + off * CONE).normalize(), number);
            !self.around.is_blocked(&ray, REACH_M)
        };
        (0..=N_CONE).filter(|i| free(*i)).count() as f64 / (N_CONE + 1) as f64
    }

    /// The reflection by a wall; `None` if the wall does not reflect the signal of the satellite.
    fn reflection(&self, satellite: &Satellite, wall: &Wall) -> Option<Reflection> {
        let to = satellite.direction;
        let facing = to.dot(&wall.normal);
        if facing < 0.02 {
            return None;
        }
        // The image of the satellite is behind the wall; the ray towards it meets the wall at the reflection point.
        let image = to - wall.normal * (2.0 * facing);
        let expected = wall.distance_m / facing;
        let number = 2000 + 2 * satellite.index as u64;
        let SurfaceHit { range_m, normal } = self.around.nearest(&self.ray(self.position, image, number), REACH_M)?;
        let on_wall = (f64::from(range_m) - expected).abs() < 0.3 && normal.cast::<f64>().dot(&wall.normal) > 0.98;
        let mirror = self.position + image * (f64::from(range_m) - 0.05);
        if !on_wall || self.around.is_blocked(&self.ray(mirror, to, number + 1), REACH_M) {
            return None;
        }
        let late_m = 2.0 * wall.distance_m * facing;
        // The detour of a moving antenna changes, so the phase averages out.
        let turns = 2.0 * facing * self.velocity.dot(&wall.normal) * SMOOTHING_SECONDS / WAVE_M;
        let half = 0.5 * TAU * turns;
        let kept = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
        Some(Reflection { late_m, fading: kept * (TAU * late_m / WAVE_M).cos() })
    }

    fn ray(&self, origin: Vector3<f64>, direction: Vector3<f64>, number: u64) -> Ray {
        Ray { origin: origin.cast(), direction: direction.cast(), seed: hash(self.seed, number) }
    }
}

/// Code range error from a reflection that is `late_m` late, with `share` of the amplitude of the direct signal and the
/// given cosine of its phase. It follows the envelope of a narrow correlator, which grows with the detour up to the
/// correlator spacing.
fn peak_shift(late_m: f64, share: f64, cosine: f64) -> f64 {
    let part = share * cosine;
    if late_m < (1.0 + part) * HALF_CORRELATOR_M { part * late_m / (1.0 + part) } else { part * HALF_CORRELATOR_M }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::gnss::sky::System;

    /// An endless wall of a height at x = `at`, viewed from the east, with the antenna between it and the sun.
    struct OneWall {
        at: f32,
        height: f32,
    }

    impl Surroundings for OneWall {
        fn is_blocked(&self, ray: &Ray, max_m: f32) -> bool {
            self.nearest(ray, max_m).is_some()
        }
        fn nearest(&self, ray: &Ray, max_m: f32) -> Option<SurfaceHit> {
            let range = (self.at - ray.origin.x) / ray.direction.x;
            let hits = range > 0.0 && range < max_m && ray.at(range).z < self.height;
            hits.then(|| SurfaceHit { range_m: range, normal: Vec3::new(-ray.direction.x.signum(), 0.0, 0.0) })
        }
    }

    fn from(x: f64, y: f64, z: f64) -> Satellite {
        Satellite { index: 3, system: System::Gps, direction: Vector3::new(x, y, z).normalize() }
    }

    #[test]
    fn open_field_signal_has_full_strength() {
        let around = OneWall { at: 1e6, height: 0.0 };
        let antenna = Antenna::new(&around, Vector3::zeros(), Vector3::zeros(), 1);
        let signal = antenna.receive(&from(0.0, 0.0, 1.0)).expect("free");
        assert_eq!(signal, Signal { strength_dbhz: 47.0, detour_m: 0.0, is_reflected: false });
    }

    #[test]
    fn blocked_satellite_gives_no_signal_and_edge_attenuates_it() {
        let around = OneWall { at: 10.0, height: 20.0 };
        let antenna = Antenna::new(&around, Vector3::zeros(), Vector3::zeros(), 1);
        assert_eq!(antenna.receive(&from(1.0, 0.3, 1.0)), None);
        let edge = antenna.receive(&from(10.0, 0.0, 20.0)).expect("half of the cone is free");
        assert!(!edge.is_reflected && edge.strength_dbhz < 44.0, "{edge:?}");
    }

    #[test]
    fn reflection_detour_equals_geometry() {
        let around = OneWall { at: -10.0, height: 100.0 };
        let still = Antenna::new(&around, Vector3::zeros(), Vector3::zeros(), 1);
        let satellite = from(1.0, 0.0, 1.0);
        let late_m = still.reflection(&satellite, &still.walls[0]).expect("an image").late_m;
        assert!((late_m - 20.0 * 0.5_f64.sqrt()).abs() < 1e-6, "{late_m}");
        // By geometry, the image of the antenna in the wall is 20 m behind it.
        let by_geometry = Vector3::new(20.0, 0.0, 0.0).dot(&satellite.direction);
        assert!((late_m - by_geometry).abs() < 1e-6);
        let signal = still.receive(&satellite).expect("free");
        assert!(signal.detour_m.abs() < REFLECTED / (1.0 - REFLECTED) * late_m && !signal.is_reflected);
        // Driving away from the wall, the phase turns fast and averages out; along it, nothing changes.
        let fading = |velocity| Antenna::new(&around, Vector3::zeros(), velocity, 1);
        let away = fading(Vector3::new(8.13, 0.0, 0.0));
        let kept = away.reflection(&satellite, &still.walls[0]).expect("one").fading;
        assert!(kept.abs() < 0.01, "{kept}");
        let along = fading(Vector3::new(0.0, 8.13, 0.0)).receive(&satellite).expect("free");
        assert!((along.detour_m - signal.detour_m).abs() < 1e-9);
    }

    #[test]
    fn non_line_of_sight_signal_is_late_by_the_full_detour() {
        /// A second wall that hides the satellite but not its image.
        struct Canyon;
        impl Surroundings for Canyon {
            fn is_blocked(&self, ray: &Ray, max_m: f32) -> bool {
                self.nearest(ray, max_m).is_some()
            }
            fn nearest(&self, ray: &Ray, max_m: f32) -> Option<SurfaceHit> {
                let walls = [OneWall { at: -8.0, height: 30.0 }, OneWall { at: 8.0, height: 12.0 }];
                let hits = walls.iter().filter_map(|wall| wall.nearest(ray, max_m));
                hits.min_by(|a, b| a.range_m.total_cmp(&b.range_m))
            }
        }
        let antenna = Antenna::new(&Canyon, Vector3::zeros(), Vector3::zeros(), 1);
        let satellite = from(1.0, 0.0, 1.0);
        let signal = antenna.receive(&satellite).expect("by the western wall");
        assert!(signal.is_reflected && (signal.detour_m - 16.0 * 0.5_f64.sqrt()).abs() < 1e-6, "{signal:?}");
    }
}
