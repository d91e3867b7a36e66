//! Sweeps that are kept for pictures.

use super::RawSweep;
use drive::{Drive, Frame};
use geometry::Stamp;
use messages::SweepPoint;
use registration::{Registered, SweepMotion};

/// Largest number of exposures of a camera that are drawn. Three are drawn; the others are substitutes where the LiDAR
/// ends early.
const EXPOSURES: usize = 5;
/// Number of sweeps that are overlaid.
const FROM_ABOVE: usize = 2;
/// Least displacement or rotation during these sweeps, m and rad, so that deskewing is visible.
const CLEAR_M: f64 = 0.5;
const CLEAR_RAD: f64 = 0.02;

/// A sweep and its motion.
#[derive(Clone, Debug)]
pub struct KeptSweep {
    /// First shot.
    pub stamp: Stamp,
    /// Time from first to last shot, ns; 0 without point times.
    pub duration_nanos: u32,
    /// `odom_from_lidar` over the sweep.
    pub motion: SweepMotion,
    /// Points, as received.
    pub rows: Vec<SweepPoint>,
    /// Whether it is drawn in the top view.
    pub is_from_above: bool,
}

/// Selection of kept sweeps.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    /// Exposures to draw, in time order.
    stamps: Vec<Stamp>,
    n_from_above: usize,
}

impl Wanted {
    /// Selects sweeps for the exposures of a part of a drive.
    pub fn new(drive: &Drive, begin: Stamp, seconds: f64) -> Self {
        let end = begin.plus_nanos((seconds * 1e9) as i64);
        let mut stamps = Vec::new();
        for camera in 0..drive.rig().cameras.len() {
            let of_camera = |frame: &&Frame| frame.camera == camera && (begin..end).contains(&frame.stamp);
            let all: Vec<Stamp> = drive.camera_frames().iter().filter(of_camera).map(|frame| frame.stamp).collect();
            stamps.extend(spread(&all, EXPOSURES));
        }
        stamps.sort_unstable();
        stamps.dedup();
        Self { stamps, n_from_above: 0 }
    }

    /// The sweep, if it is selected.
    pub fn keep(&mut self, raw: &RawSweep, registered: &Registered) -> Option<KeptSweep> {
        let end = raw.stamp.plus_nanos(i64::from(raw.header.duration_nanos));
        let is_of_exposure = self.stamps.iter().any(|stamp| (raw.stamp..end).contains(stamp));
        let motion = &registered.motion;
        let is_clear = motion.translation.norm() > CLEAR_M || motion.rotation.norm() > CLEAR_RAD;
        // Two consecutive sweeps.
        let is_from_above = self.n_from_above < FROM_ABOVE && (is_clear || self.n_from_above > 0);
        self.n_from_above += usize::from(is_from_above);
        (is_of_exposure || is_from_above).then(|| KeptSweep {
            stamp: raw.stamp,
            duration_nanos: registered.duration_nanos,
            motion: *motion,
            rows: raw.rows.clone(),
            is_from_above,
        })
    }
}

/// At most `n` elements of a list, spread evenly from the first to the last.
pub(crate) fn spread<T: Copy>(all: &[T], n: usize) -> Vec<T> {
    if all.len() <= n {
        return all.to_vec();
    }
    (0..n).map(|i| all[i * (all.len() - 1) / (n - 1).max(1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_has_the_first_and_the_last() {
        let all: Vec<usize> = (0..10).collect();
        assert_eq!(spread(&all, 3), [0, 4, 9]);
        assert_eq!(spread(&all[..2], 3), [0, 1]);
        assert_eq!(spread(&all, 1), [0]);
    }
}
