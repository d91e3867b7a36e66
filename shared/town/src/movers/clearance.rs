//! Admission of movers: no mover may intersect the ego vehicle or another mover.

use crate::movers::mover::Mover;
use crate::path::GroundPath;
use crate::speed_profile::SpeedProfile;
use nalgebra::Vector2;

/// Time step of the check, s: no mover covers more than half its own length.
const STEP_SECONDS: f64 = 0.2;
/// Margin around every footprint, m.
const MARGIN_M: f64 = 0.25;
/// Half length and half width of the ego vehicle, m.
const VEHICLE_HALF: [f64; 2] = [2.5, 1.0];
/// Movers that never come closer to the ego vehicle than this are dropped, m.
const NEAR_M: f64 = 100.0;

/// A rectangle on the ground.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    center: Vector2<f64>,
    forward: Vector2<f64>,
    half: [f64; 2],
}

impl Footprint {
    /// Whether two rectangles intersect, by separating axes.
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

/// Footprints of the ego vehicle and all admitted movers over the drive.
#[derive(Debug)]
pub struct Clearance {
    seconds: f64,
    vehicle: Vec<Footprint>,
    others: Vec<Vec<Footprint>>,
}

impl Clearance {
    /// Starts with only the ego vehicle.
    pub fn new(path: &GroundPath, speed: &SpeedProfile, seconds: f64) -> Self {
        let at = |t: f64| {
            let frame = path.frame(speed.distance_m(t), 0.0, 0.0);
            let forward = (frame.rotation * nalgebra::Vector3::x()).xy().normalize();
            Footprint { center: frame.translation.vector.xy(), forward, half: VEHICLE_HALF.map(|h| h + MARGIN_M) }
        };
        Self { seconds, vehicle: times(seconds).map(at).collect(), others: Vec::new() }
    }
    /// Admits a mover if it comes close to the ego vehicle and intersects no other mover; returns whether it was
    /// admitted.
    pub fn admit(&mut self, mover: &Mover) -> bool {
        let prints = self.prints(mover, MARGIN_M);
        let is_near = prints.iter().zip(&self.vehicle).any(|(a, b)| (a.center - b.center).norm() < NEAR_M);
        let meets = |others: &Vec<Footprint>| prints.iter().zip(others).any(|(a, b)| a.meets(b));
        if !is_near || meets(&self.vehicle) || self.others.iter().any(meets) {
            return false;
        }
        self.others.push(prints);
        true
    }
    /// Admits a vehicle of a queue if it does not intersect the ego vehicle; in turns it may touch vehicles of the next
    /// lane.
    pub fn admit_queued(&mut self, mover: &Mover) -> bool {
        let prints = self.prints(mover, 0.0);
        let is_free = !prints.iter().zip(&self.vehicle).any(|(a, b)| a.meets(b));
        if is_free {
            self.others.push(prints);
        }
        is_free
    }
    fn prints(&self, mover: &Mover, margin_m: f64) -> Vec<Footprint> {
        let [low, high] = mover.bounds();
        let half = [0, 1].map(|axis| 0.5 * f64::from(high[axis] - low[axis]) + margin_m);
        let middle = nalgebra::Point3::from((low + high) * 0.5).cast::<f64>();
        times(self.seconds)
            .map(|t| {
                let pose = mover.route.pose(t);
                let forward = (pose.rotation * nalgebra::Vector3::x()).xy();
                let forward = forward.try_normalize(1e-9).unwrap_or_else(Vector2::x);
                Footprint { center: (pose * middle).xy().coords, forward, half }
            })
            .collect()
    }
}

fn times(seconds: f64) -> impl Iterator<Item = f64> {
    (0..=(seconds / STEP_SECONDS).ceil() as usize + 1).map(|i| i as f64 * STEP_SECONDS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprints_meet_where_they_overlap() {
        let at = |x: f64, y: f64, angle: f64| Footprint {
            center: Vector2::new(x, y),
            forward: Vector2::new(angle.cos(), angle.sin()),
            half: [2.0, 1.0],
        };
        assert!(at(0.0, 0.0, 0.0).meets(&at(3.9, 0.0, 0.0)));
        assert!(!at(0.0, 0.0, 0.0).meets(&at(4.1, 0.0, 0.0)));
        // Side by side in opposite lanes.
        assert!(!at(0.0, 0.0, 0.0).meets(&at(0.0, 2.1, std::f64::consts::PI)));
        // Turned by 45 degrees, a corner reaches 2.1 m.
        assert!(at(0.0, 0.0, 0.0).meets(&at(3.9, 0.0, 0.785)));
        assert!(!at(0.0, 0.0, 0.0).meets(&at(4.3, 0.0, 0.785)));
    }
}
