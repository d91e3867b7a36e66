//! A street scanned by a 32-beam LiDAR: road, two facades, parked boxes. Cheap to compute, because its rays are also
//! cast under valgrind.

use random::{gauss, hash, unit};

/// Firings of one revolution: half of an HDL-32E's.
const FIRINGS: u32 = 1085;
const FIRING_NANOS: u32 = 92_160;
pub const RINGS: u32 = 32;
/// Speed of the vehicle, m/s.
const SPEED: f64 = 3.0;
/// Height of the LiDAR above the road, m.
const HEIGHT: f64 = 1.8;

/// One return, in the frame of the LiDAR at the time of the shot.
#[derive(Clone, Copy)]
pub struct Shot {
    pub position: [f32; 3],
    pub offset_nanos: u32,
    /// Azimuth, 0.01 deg.
    pub azimuth: u16,
    pub ring: u8,
}

/// Stamp of the first shot of a sweep, ns.
pub fn stamp(number: u32) -> i64 {
    i64::from(number) * i64::from(FIRINGS * FIRING_NANOS)
}

/// Position of the LiDAR along the road, m.
pub fn along(nanos: i64) -> f64 {
    SPEED * nanos as f64 * 1e-9
}

/// Returns of one revolution.
pub fn sweep(number: u32) -> Vec<Shot> {
    let mut shots = Vec::new();
    for firing in 0..FIRINGS {
        let offset_nanos = firing * FIRING_NANOS;
        let x = along(stamp(number) + i64::from(offset_nanos));
        let degrees = f64::from(firing) / f64::from(FIRINGS) * 360.0;
        let (sin, cos) = degrees.to_radians().sin_cos();
        for ring in 0..RINGS {
            let (up, out) = (-30.67 + f64::from(ring) * 4.0 / 3.0).to_radians().sin_cos();
            let ray = [out * cos, -out * sin, up];
            let Some(range) = range(x, ray) else { continue };
            let measured = range as f32 + 0.02 * gauss(u64::from((number * FIRINGS + firing) * RINGS + ring));
            let position = ray.map(|axis| axis as f32 * measured);
            shots.push(Shot { position, offset_nanos, azimuth: (degrees * 100.0) as u16, ring: ring as u8 });
        }
    }
    shots
}

fn range(x: f64, ray: [f64; 3]) -> Option<f64> {
    let mut nearest = if ray[2] < 0.0 { -HEIGHT / ray[2] } else { f64::INFINITY };
    // Houses of 7 m, every other one 1 m behind its neighbors.
    let to_wall = 9.0 / ray[1].abs();
    let house = ((x + to_wall * ray[0]) / 7.0).floor();
    let to_front = if house.rem_euclid(2.0) == 0.0 { to_wall } else { to_wall * 10.0 / 9.0 };
    if HEIGHT + to_front * ray[2] < 9.0 {
        nearest = nearest.min(to_front);
    }
    // Boxes on both sides, about every 6 m, each with its own size and position.
    let right = f64::from(u8::from(ray[1] < 0.0));
    let first = (x / 6.0).floor();
    for place in -5..=5 {
        let number = first + f64::from(place);
        let share = |what: u64| f64::from(unit(hash(what, (2.0 * number + right + 1000.0) as u64)));
        let half = [1.0 + 1.2 * share(0), 0.5 + 0.6 * share(1), 0.5 + 0.9 * share(2)];
        let side = (4.0 + 2.5 * share(3)).copysign(ray[1]);
        let center = [number * 6.0 + 2.0 * share(4) - x, side, half[2] - HEIGHT];
        nearest = nearest.min(to_box(center, half, ray));
    }
    (nearest < 80.0).then_some(nearest)
}

/// Distance to a box along a ray, infinite if the ray misses it.
fn to_box(center: [f64; 3], half: [f64; 3], ray: [f64; 3]) -> f64 {
    let mut enters = 0.0_f64;
    let mut leaves = f64::INFINITY;
    for axis in 0..3 {
        let [a, b] = [-half[axis], half[axis]].map(|end| (center[axis] + end) / ray[axis]);
        enters = enters.max(a.min(b));
        leaves = leaves.min(a.max(b));
    }
    if enters < leaves { enters } else { f64::INFINITY }
}
