//! Sweeps of the topic, prepared for the odometry and for the submap.

use crate::Settings;
use geometry::Stamp;
use messages::{SweepPoint, SweepTopic};
use registration::{SpinDirection, TimedPoint};
use stage::Received;

/// A received sweep and its points for the odometry.
pub(crate) struct IncomingSweep {
    pub received: Received<SweepTopic>,
    pub sweep: registration::Sweep,
}

impl IncomingSweep {
    pub fn new(received: Received<SweepTopic>, settings: &Settings) -> Self {
        let header = received.header();
        let timed = |point: &SweepPoint| TimedPoint {
            position: [point.x, point.y, point.z],
            offset_nanos: if header.has_times == 0 { 0 } else { point.offset_nanos },
            ring: point.ring,
        };
        let mut points: Vec<TimedPoint> = received.rows().iter().map(timed).collect();
        let spin = match settings.untimed_turn.as_str() {
            "clockwise" => Some(SpinDirection::Clockwise),
            "counterclockwise" => Some(SpinDirection::Counterclockwise),
            _ => None,
        };
        if let Some(spin) = spin.filter(|_| header.has_times == 0) {
            registration::set_times_from_azimuth(&mut points, spin, (settings.untimed_turn_s * 1e9) as u32);
        }
        let sweep = registration::Sweep::new(Stamp(received.stamp()), points, header.n_rings);
        Self { received, sweep }
    }
}

/// The points of a sweep that go into the submap; independent of the motion.
pub(crate) struct KeptPoints {
    /// Indices of the points, ascending.
    pub indices: Vec<usize>,
    /// Points that were dropped: nearer than `min_range_m`, or not finite.
    pub n_dropped: usize,
    /// See [`registration::Sweep::incidences`].
    pub incidences: Vec<f32>,
}

impl KeptPoints {
    pub fn of(sweep: &registration::Sweep, settings: &Settings) -> Self {
        let points = sweep.points();
        let is_in_range = |idx: &usize| {
            let [x, y, z] = points[*idx].position;
            let squared = x * x + y * y + z * z;
            squared.is_finite() && squared >= (settings.min_range_m * settings.min_range_m) as f32
        };
        let in_range: Vec<usize> = (0..points.len()).filter(is_in_range).collect();
        let n_dropped = points.len() - in_range.len();
        let indices = if settings.thin_m == 0.0 {
            in_range
        } else {
            let firsts = registration::thinned(in_range.iter().map(|&idx| points[idx].position), settings.thin_m);
            firsts.into_iter().map(|first| in_range[first]).collect()
        };
        Self { indices, n_dropped, incidences: sweep.incidences() }
    }
}
