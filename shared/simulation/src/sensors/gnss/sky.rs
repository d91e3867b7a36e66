//! Satellite positions: nominal constellations of GPS and Galileo on circular orbits.

use super::place::world;
use geometry::Vector3;
use random::{hash, unit};
use std::f64::consts::TAU;

/// Gravitation of the Earth, m^3/s^2 (IS-GPS-200).
const EARTH_GM: f64 = 3.986_005e14;
/// Rate of rotation of the Earth, rad/s (IS-GPS-200).
pub const EARTH_RATE: f64 = 7.292_115_146_7e-5;

/// A satellite system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    /// 30 satellites in 6 planes.
    Gps,
    /// 24 satellites in 3 planes.
    Galileo,
}

/// Walker constellation.
struct Walker {
    inclination_deg: f64,
    n_satellites: u32,
    n_planes: u32,
    /// Phase shift from plane to plane in units of a full turn divided by the number of satellites.
    phase_shift: u32,
    orbit_radius_m: f64,
}

impl System {
    /// GPS has five or more satellites in each of its six planes; Galileo is Walker 24/3/1 (its OS SIS ICD).
    const fn walker(self) -> Walker {
        match self {
            Self::Gps => Walker {
                inclination_deg: 55.0,
                n_satellites: 30,
                n_planes: 6,
                phase_shift: 1,
                orbit_radius_m: 26_560e3,
            },
            Self::Galileo => Walker {
                inclination_deg: 56.0,
                n_satellites: 24,
                n_planes: 3,
                phase_shift: 1,
                orbit_radius_m: 29_600e3,
            },
        }
    }
}

/// Number of satellites.
pub const N_SATELLITES: usize = 54;

/// One satellite above the horizon.
#[derive(Clone, Copy, Debug)]
pub struct Satellite {
    /// Index, 0 to [`N_SATELLITES`] - 1.
    pub index: usize,
    /// System.
    pub system: System,
    /// Direction to the satellite, unit, world frame.
    pub direction: Vector3<f64>,
}

/// Both constellations, rotated by the seed.
#[derive(Clone, Copy, Debug)]
pub struct Sky {
    /// Angles of the node of the first orbit and of its first satellite, rad, by system.
    turns: [[f64; 2]; 2],
}

impl Sky {
    /// The constellations rotated by a seed.
    pub fn new(seed: u64) -> Self {
        let turn = |i: u64| f64::from(unit(hash(seed, i))) * TAU;
        Self { turns: [[turn(0), turn(1)], [turn(2), turn(3)]] }
    }

    /// The satellites above the horizon at the origin of the world, by index.
    pub fn above(&self, seconds: f64) -> Vec<Satellite> {
        let mut index = 0;
        let mut satellites = Vec::new();
        let world = world();
        for (system, [node, phase]) in [System::Gps, System::Galileo].into_iter().zip(self.turns) {
            let Walker {
                inclination_deg,
                n_satellites: n,
                n_planes: planes,
                phase_shift: shift,
                orbit_radius_m: radius,
            } = system.walker();
            let rate = (EARTH_GM / radius.powi(3)).sqrt();
            let (sin_i, cos_i) = inclination_deg.to_radians().sin_cos();
            for plane in 0..planes {
                // The Earth rotates below the orbits.
                let node = node + TAU * f64::from(plane) / f64::from(planes) - EARTH_RATE * seconds;
                for slot in 0..n / planes {
                    let along = f64::from(slot * planes) + f64::from(plane * shift);
                    let anomaly = phase + TAU * along / f64::from(n) + rate * seconds;
                    let x = anomaly.cos();
                    let y = anomaly.sin();
                    let at = Vector3::new(
                        x * node.cos() - y * cos_i * node.sin(),
                        x * node.sin() + y * cos_i * node.cos(),
                        y * sin_i,
                    );
                    let direction = world.world_from_ecef(&(at * radius)).coords.normalize();
                    if direction.z > 0.0 {
                        satellites.push(Satellite { index, system, direction });
                    }
                    index += 1;
                }
            }
        }
        satellites
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constellation_has_realistic_satellite_count_and_motion() {
        for seed in 0..40 {
            let sky = Sky::new(seed);
            let high: Vec<Satellite> = sky.above(0.0).into_iter().filter(|s| s.direction.z > 0.26).collect();
            let of = |system| high.iter().filter(|s| s.system == system).count();
            assert!((5..=14).contains(&of(System::Gps)) && (4..=11).contains(&of(System::Galileo)), "seed {seed}");
            for later in sky.above(60.0) {
                assert!(later.index < N_SATELLITES);
                if let Some(before) = high.iter().find(|s| s.index == later.index) {
                    // A period of twelve hours is half a degree per minute, and slightly more relative to the Earth.
                    let angle = before.direction.angle(&later.direction).to_degrees();
                    assert!(angle > 0.05 && angle < 0.8, "{angle}");
                }
            }
        }
    }

    #[test]
    fn no_satellite_is_in_the_northern_sky() {
        // Orbits with an inclination of 55 degrees leave a hole around the pole. Its far side is just above the horizon.
        let mut n_south = 0;
        for seed in 0..200 {
            for satellite in Sky::new(seed).above(0.0) {
                let d = satellite.direction;
                let elevation_deg = d.z.asin().to_degrees();
                if d.x.abs() < 0.1 * d.y.abs() && (12.0..60.0).contains(&elevation_deg) {
                    assert!(d.y < 0.0, "{elevation_deg} degrees high in the north");
                    n_south += 1;
                }
            }
        }
        assert!(n_south > 50, "{n_south}");
    }
}
