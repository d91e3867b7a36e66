//! Sweeps as they come and as the odometry sees them.

use crate::Settings;
use geometry::Stamp;
use messages::{Sweep, SweepPoint};
use registration::{TimedPoint, Turn};
use stage::Received;

/// A sweep on its way through the stage.
pub(crate) struct Cloud {
    pub received: Received<Sweep>,
    pub sweep: registration::Sweep,
}

impl Cloud {
    pub fn new(received: Received<Sweep>, settings: &Settings) -> Self {
        let header = received.header();
        let timed = |point: &SweepPoint| TimedPoint {
            position: [point.x, point.y, point.z],
            offset_nanos: if header.has_times == 0 { 0 } else { point.offset_nanos },
            ring: point.ring,
        };
        let mut points: Vec<TimedPoint> = received.rows().iter().map(timed).collect();
        let turn = match settings.untimed_turn.as_str() {
            "clockwise" => Some(Turn::Clockwise),
            "counterclockwise" => Some(Turn::Counterclockwise),
            _ => None,
        };
        if let Some(turn) = turn.filter(|_| header.has_times == 0) {
            registration::set_times_from_azimuth(&mut points, turn, (settings.untimed_turn_s * 1e9) as u32);
        }
        let sweep = registration::Sweep::new(Stamp(received.stamp()), points, header.n_rings);
        Self { received, sweep }
    }
    /// Indices of the points that go into the submap, and how many are no returns of the scene: nearer than
    /// `min_range_m`, or no numbers.
    pub fn kept(&self, min_range_m: f64, thin_m: f64) -> (Vec<usize>, usize) {
        let points = self.sweep.points();
        let is_scene = |idx: &usize| {
            let [x, y, z] = points[*idx].position;
            let squared = x * x + y * y + z * z;
            squared.is_finite() && squared >= (min_range_m * min_range_m) as f32
        };
        let scene: Vec<usize> = (0..points.len()).filter(is_scene).collect();
        let n_dropped = points.len() - scene.len();
        if thin_m == 0.0 {
            return (scene, n_dropped);
        }
        let firsts = registration::thinned(scene.iter().map(|&idx| points[idx].position), thin_m);
        (firsts.into_iter().map(|first| scene[first]).collect(), n_dropped)
    }
}
