//! A synthetic street with ground truth, small enough for ray casting in a test: ground, rough facades with recesses, poles, parked
//! boxes; a tilted spinning LiDAR that moves during each sweep.

use geometry::{Isometry3, Pose, Stamp, UnitQuaternion, Vector3};
use registration::{Sweep, TimedPoint};

/// Number of firings of one revolution, and the time between them: an HDL-32E at 10 Hz.
const FIRINGS: u32 = 2170;
const FIRING_NANOS: u32 = 46_080;
const RINGS: u8 = 32;

/// One drive through the street.
pub struct Drive {
    /// Speed at the start, m/s.
    pub speed: f64,
    /// Range noise, m.
    pub noise_m: f32,
    /// Only ground: position and heading are unobservable.
    pub ground_only: bool,
}

pub fn body_from_lidar() -> Pose {
    Isometry3::new(Vector3::new(0.3, 0.0, 2.1), Vector3::y() * 30_f64.to_radians())
}

impl Drive {
    /// `world_from_body` at a time in s: the speed varies by a fifth and the road winds.
    pub fn world_from_body(&self, t: f64) -> Pose {
        let x = self.speed * (t + 0.2 * (1.0 - (t * 0.9).cos()) / 0.9);
        let heading = 0.16 * (x / 17.0).sin();
        // y is the integral of the heading along x, to first order; the truth need not be a drivable path.
        let y = 0.16 * 17.0 * (1.0 - (x / 17.0).cos());
        let sway = Vector3::new(0.006 * (t * 7.0).sin(), 0.008 * (t * 9.0).sin(), heading);
        Isometry3::from_parts(
            Vector3::new(x, y, 0.01 * (t * 8.0).sin()).into(),
            UnitQuaternion::from_euler_angles(sway.x, sway.y, sway.z),
        )
    }
    /// `world_from_lidar` at a time in s.
    pub fn world_from_lidar(&self, t: f64) -> Pose {
        self.world_from_body(t) * body_from_lidar()
    }
    /// The sample of a perfect inertial unit at the body's origin at a time in s: specific force, m/s^2, and angular rate, rad/s.
    pub fn inertial(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        // Truncation and rounding are both below 1e-5 m/s^2.
        let h = 1e-3;
        let [before, here, after] = [t - h, t, t + h].map(|t| self.world_from_body(t));
        let position = |pose: &Pose| pose.translation.vector;
        let acceleration = (position(&after) - 2.0 * position(&here) + position(&before)) / (h * h);
        let force = here.rotation.inverse() * (acceleration + Vector3::z() * 9.806);
        (force, (before.rotation.inverse() * after.rotation).scaled_axis() / (2.0 * h))
    }
    /// Velocity of the body's origin, m/s, world axes.
    pub fn velocity(&self, t: f64) -> Vector3<f64> {
        let [before, after] = [t - 1e-3, t + 1e-3].map(|t| self.world_from_body(t).translation.vector);
        (after - before) / 2e-3
    }
    /// Sweep `number` with its true times.
    pub fn sweep(&self, number: u32) -> Sweep {
        self.sweep_at(&|t| self.world_from_lidar(t), number)
    }
    /// Sweep `number` of a LiDAR with another motion, by the time in s.
    pub fn sweep_at(&self, world_from_lidar: &dyn Fn(f64) -> Pose, number: u32) -> Sweep {
        let begin_nanos = i64::from(number) * i64::from(FIRINGS * FIRING_NANOS);
        let mut points = Vec::new();
        for firing in 0..FIRINGS {
            let offset_nanos = firing * FIRING_NANOS;
            let pose = world_from_lidar((begin_nanos + i64::from(offset_nanos)) as f64 * 1e-9);
            let azimuth = -f64::from(firing) / f64::from(FIRINGS) * std::f64::consts::TAU;
            for ring in 0..RINGS {
                let elevation = (-30.67 + f64::from(ring) * 1.333_33_f64).to_radians();
                let ray =
                    Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
                let Some(range) = self.range(&pose.translation.vector, &(pose.rotation * ray)) else { continue };
                let seed = (u64::from(number) * u64::from(FIRINGS) + u64::from(firing)) * 32 + u64::from(ring);
                let measured = range as f32 + self.noise_m * gauss(seed);
                points.push(TimedPoint { position: (ray.cast::<f32>() * measured).into(), offset_nanos, ring });
            }
        }
        Sweep::new(Stamp(begin_nanos), points, u32::from(RINGS))
    }

    fn range(&self, from: &Vector3<f64>, ray: &Vector3<f64>) -> Option<f64> {
        let mut nearest = f64::MAX;
        let mut hit = |range: f64| {
            if range > 0.5 && range < nearest {
                nearest = range;
            }
        };
        if ray.z < 0.0 {
            hit(-from.z / ray.z);
        }
        if self.ground_only {
            // Only the strip that is visible between the facades of the street.
            let across = from.y + nearest * ray.y;
            return (across.abs() < 8.0 && nearest < 90.0).then_some(nearest);
        }
        // Visible houses; the street is endless.
        let here = (from.x / 7.0).floor() as i32;
        for house in (here - 16).max(-8)..=(here + 24).max(24) {
            for side in [-1.0, 1.0] {
                hit(facade_range(from, ray, house, side));
                hit(corner_range(from, ray, house, side));
                hit(box_range(from, ray, house, side));
                hit(pole_range(from, ray, house, side));
            }
        }
        (nearest < 90.0).then_some(nearest)
    }
}

/// How far a house's front is from the middle of the road, m.
fn front(house: i32, side: f64) -> f64 {
    9.0 + 1.2 * noise(house * 2 + i32::from(side > 0.0))
}

/// The front of a house: 7 m wide, 9 m high, with recessed windows and a rough surface. The relief is measured across
/// the front, not along the ray: a wall whose shape depends on the viewpoint rotates the vehicle, always in the same
/// sense.
fn facade_range(from: &Vector3<f64>, ray: &Vector3<f64>, house: i32, side: f64) -> f64 {
    let front = front(house, side);
    let range_to = |out: f64| (side * out - from.y) / ray.y;
    let range = range_to(front);
    let along = from.x + range * ray.x;
    let height = from.z + range * ray.z;
    let inside = along >= f64::from(house) * 7.0 && along < f64::from(house + 1) * 7.0 && height < 9.0;
    if range > 0.0 && inside { range_to(front - relief(along, height, side)) } else { f64::MAX }
}

/// The side wall of a house that is set back from the previous one.
fn corner_range(from: &Vector3<f64>, ray: &Vector3<f64>, house: i32, side: f64) -> f64 {
    let range = (f64::from(house) * 7.0 - from.x) / ray.x;
    let out = side * (from.y + range * ray.y);
    let height = from.z + range * ray.z;
    let before = front(house - 1, side);
    let after = front(house, side);
    let inside = out > before.min(after) && out < before.max(after) && height < 9.0;
    if range > 0.0 && inside { range } else { f64::MAX }
}

/// Windows and plaster, m towards the street.
fn relief(along: f64, height: f64, side: f64) -> f64 {
    let window = (along.rem_euclid(2.3) > 1.2) && (height.rem_euclid(2.8) > 1.1);
    let cell = (along * 3.0).floor() as i32 * 7919 + (height * 3.0).floor() as i32 * 31 + side as i32;
    if window { -0.18 } else { 0.03 * noise(cell) }
}

/// A parked box of 4 x 1.8 x 1.5 m at the roadside, at two of three houses.
fn box_range(from: &Vector3<f64>, ray: &Vector3<f64>, house: i32, side: f64) -> f64 {
    if (house + i32::from(side > 0.0)).rem_euclid(3) == 0 {
        return f64::MAX;
    }
    let low = Vector3::new(f64::from(house) * 7.0 + 1.0 + noise(house), side * 5.0 - 0.9, 0.2);
    let high = low + Vector3::new(4.0, 1.8, 1.3);
    let mut enter = 0.0_f64;
    let mut leave = f64::MAX;
    for axis in 0..3 {
        let a = (low[axis] - from[axis]) / ray[axis];
        let b = (high[axis] - from[axis]) / ray[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    if enter > 0.0 && enter < leave { enter } else { f64::MAX }
}

/// A pole of 12 cm radius at the kerb.
fn pole_range(from: &Vector3<f64>, ray: &Vector3<f64>, house: i32, side: f64) -> f64 {
    let dx = f64::from(house) * 7.0 + 3.0 * noise(house + 500) - from.x;
    let dy = side * 6.6 - from.y;
    let height = |range: f64| from.z + range * ray.z;
    let a = ray.x * ray.x + ray.y * ray.y;
    let b = ray.x * dx + ray.y * dy;
    let root = b * b - a * (dx * dx + dy * dy - 0.0144);
    if root < 0.0 || b < 0.0 {
        return f64::MAX;
    }
    let range = (b - root.sqrt()) / a;
    if height(range) < 5.0 { range } else { f64::MAX }
}

/// Seeded noise, uniform in -0.5 to 0.5.
fn noise(seed: i32) -> f64 {
    hash(seed as u64) - 0.5
}

/// Seeded noise, standard normal to a good approximation: a sum of four uniforms.
fn gauss(seed: u64) -> f32 {
    let sum: f64 = (0..4).map(|i| hash(seed * 4 + i)).sum();
    // Four uniforms have variance 1/3.
    ((sum - 2.0) * 3.0_f64.sqrt()) as f32
}

/// Uniform in 0 to 1. The figures of the street in the bench `odometry` depend on these numbers.
fn hash(seed: u64) -> f64 {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    const OFFSET: u64 = 0x1234_5678_9abc_def1_u64.wrapping_sub(STEP);
    let bits = random::mix(seed.wrapping_mul(STEP).wrapping_add(OFFSET));
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}
