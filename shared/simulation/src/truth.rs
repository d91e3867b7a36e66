//! Ground truth: poses every 10 ms, and class and instance of every return.

use crate::motion::Motion;
use crate::sensors::lidar::{Block, LidarReturn};
use geometry::Trajectory;

/// Period of the poses, ns.
const PERIOD_NANOS: i64 = 10_000_000;

/// `world_from_body` from the start to at least `seconds`.
pub fn trajectory(motion: &Motion, seconds: f64) -> Trajectory {
    let mut trajectory = Trajectory::default();
    let n = (seconds * 1e9 / PERIOD_NANOS as f64).ceil() as i64;
    for i in 0..=n {
        let stamp = motion.begin.plus_nanos(i * PERIOD_NANOS);
        trajectory.push(stamp, motion.pose_at(stamp));
    }
    trajectory
}

/// Label of a return in the encoding of SemanticKITTI: class in the lower 16 bits, instance in the upper 16.
pub fn label(of: &LidarReturn) -> u32 {
    of.class as u32 | u32::from(of.instance) << 16
}

/// Splits the stream of blocks into revolutions where the encoder angle wraps, as decoders do.
#[derive(Debug, Default)]
pub struct Revolutions {
    last_azimuth: Option<u16>,
    labels: Vec<u32>,
}

impl Revolutions {
    /// Adds the next block. If the block completes a revolution, returns the labels of the revolution.
    pub fn push(&mut self, block: &Block) -> Option<Vec<u32>> {
        let wraps = self.last_azimuth.is_some_and(|last| block.azimuth < last);
        self.last_azimuth = Some(block.azimuth);
        let done = wraps.then(|| std::mem::take(&mut self.labels));
        self.labels.extend(block.returns.iter().flatten().map(label));
        done
    }
    /// Labels of the last, incomplete revolution.
    pub fn finish(self) -> Vec<u32> {
        self.labels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::ClassId;

    #[test]
    fn revolution_ends_where_azimuth_wraps() {
        let block = |azimuth: u16, n: usize| {
            let some = LidarReturn { range_2mm: 900, intensity: 3, class: ClassId::Pole, instance: 2, range_m: 1.8 };
            Block { azimuth, is_lower: false, returns: std::array::from_fn(|i| (i < n).then_some(some)) }
        };
        let mut revolutions = Revolutions::default();
        assert_eq!(revolutions.push(&block(100, 4)), None);
        assert_eq!(revolutions.push(&block(35_990, 1)), None);
        assert_eq!(revolutions.push(&block(7, 2)), Some(vec![5 | 2 << 16; 5]));
        assert_eq!(revolutions.finish().len(), 2);
    }
}
