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
}

/// What goes into the submap of a sweep, whatever its motion.
pub(crate) struct Scene {
    /// Indices of the points that are returns of the scene, rising.
    pub kept: Vec<usize>,
    /// Points that are not: nearer than `min_range_m`, or no numbers.
    pub n_dropped: usize,
    /// See [`registration::Sweep::incidences`].
    pub incidences: Vec<f32>,
}

impl Scene {
    pub fn of(sweep: &registration::Sweep, settings: &Settings) -> Self {
        let points = sweep.points();
        let is_scene = |idx: &usize| {
            let [x, y, z] = points[*idx].position;
            let squared = x * x + y * y + z * z;
            squared.is_finite() && squared >= (settings.min_range_m * settings.min_range_m) as f32
        };
        let scene: Vec<usize> = (0..points.len()).filter(is_scene).collect();
        let n_dropped = points.len() - scene.len();
        let kept = if settings.thin_m == 0.0 {
            scene
        } else {
            let firsts = registration::thinned(scene.iter().map(|&idx| points[idx].position), settings.thin_m);
            firsts.into_iter().map(|first| scene[first]).collect()
        };
        Self { kept, n_dropped, incidences: sweep.incidences() }
    }
}
