//! Who may move: nobody drives or walks through anybody else.

use super::mover::Mover;
use crate::pace::Pace;
use crate::way::Way;
use nalgebra::Vector2;

/// Between two looks at the traffic, s: nothing moves more than half its own length.
const STEP_SECONDS: f64 = 0.2;
/// Kept free around everything, m.
const MARGIN_M: f64 = 0.25;
/// The recording vehicle: half its length and width, m.
const VEHICLE_HALF: [f64; 2] = [2.5, 1.0];
/// Who never comes this near to the recording vehicle is left out, m.
const NEAR_M: f64 = 100.0;

/// A rectangle on the ground.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    center: Vector2<f64>,
    forward: Vector2<f64>,
    half: [f64; 2],
}

impl Footprint {
    /// Separating axes of two rectangles.
    fn meets(&self, other: &Self) -> bool {
        let to = other.center - self.center;
        let reach = self.half[0] + self.half[1] + other.half[0] + other.half[1];
        if to.norm_squared() > reach * reach {
            return false;
        }
        let axes = |f: &Self| [f.forward, Vector2::new(-f.forward.y, f.forward.x)];
        let extent = |f: &Self, axis: &Vector2<f64>| {
            let [x, y] = axes(f);
            f.half[0] * x.dot(axis).abs() + f.half[1] * y.dot(axis).abs()
        };
        let all = [axes(self), axes(other)];
        all.iter().flatten().all(|axis| to.dot(axis).abs() < extent(self, axis) + extent(other, axis))
    }
}

/// Everybody who has been admitted, at all times of the drive.
#[derive(Debug)]
pub struct Clearance {
    seconds: f64,
    vehicle: Vec<Footprint>,
    others: Vec<Vec<Footprint>>,
}

impl Clearance {
    /// With the recording vehicle alone.
    pub fn new(way: &Way, pace: &Pace, seconds: f64) -> Self {
        let at = |t: f64| {
            let frame = way.frame(pace.length_m(t), 0.0, 0.0);
            let forward = (frame.rotation * nalgebra::Vector3::x()).xy().normalize();
            Footprint { center: frame.translation.vector.xy(), forward, half: VEHICLE_HALF.map(|h| h + MARGIN_M) }
        };
        Self { seconds, vehicle: times(seconds).map(at).collect(), others: Vec::new() }
    }
    /// Takes a mover that comes near the recording vehicle and meets nobody.
    pub fn admit(&mut self, mover: &Mover) -> bool {
        let Some([low, high]) = mover.model.bounds() else { return false };
        let half = [0, 1].map(|axis| 0.5 * f64::from(high[axis] - low[axis]) + MARGIN_M);
        let middle = nalgebra::Point3::from((low + high) * 0.5).cast::<f64>();
        let prints: Vec<Footprint> = times(self.seconds)
            .map(|t| {
                let pose = mover.route.pose(t);
                let forward = (pose.rotation * nalgebra::Vector3::x()).xy();
                let forward = forward.try_normalize(1e-9).unwrap_or_else(Vector2::x);
                Footprint { center: (pose * middle).xy().coords, forward, half }
            })
            .collect();
        let is_near = prints.iter().zip(&self.vehicle).any(|(a, b)| (a.center - b.center).norm() < NEAR_M);
        let meets = |others: &Vec<Footprint>| prints.iter().zip(others).any(|(a, b)| a.meets(b));
        if !is_near || meets(&self.vehicle) || self.others.iter().any(meets) {
            return false;
        }
        self.others.push(prints);
        true
    }
}

fn times(seconds: f64) -> impl Iterator<Item = f64> {
    (0..=(seconds / STEP_SECONDS).ceil() as usize + 1).map(|i| i as f64 * STEP_SECONDS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_meet_where_they_overlap() {
        let at = |x: f64, y: f64, angle: f64| Footprint {
            center: Vector2::new(x, y),
            forward: Vector2::new(angle.cos(), angle.sin()),
            half: [2.0, 1.0],
        };
        assert!(at(0.0, 0.0, 0.0).meets(&at(3.9, 0.0, 0.0)));
        assert!(!at(0.0, 0.0, 0.0).meets(&at(4.1, 0.0, 0.0)));
        // Side by side in opposite lanes.
        assert!(!at(0.0, 0.0, 0.0).meets(&at(0.0, 2.1, 3.14)));
        // Turned by 45 degrees, a corner reaches 2.1 m.
        assert!(at(0.0, 0.0, 0.0).meets(&at(3.9, 0.0, 0.785)));
        assert!(!at(0.0, 0.0, 0.0).meets(&at(4.3, 0.0, 0.785)));
    }
}
