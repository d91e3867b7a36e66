//! The trigger rule of the vehicle's cameras: once a second, and only after one metre of path (thesis 2.5.1).
//!
//! The rule thins out recordings of free-running cameras. Recordings that were triggered pass unchanged: the limits are a little
//! lower, because triggers jitter and the distance between exposures follows from fixes.

use super::odometer::Odometer;
use drive::Frame;
use geometry::Stamp;
use std::collections::BTreeMap;

/// Share of the period that must have passed: a camera at 10 Hz is still thinned out to 1 Hz.
const PERIOD_SHARE: f64 = 0.95;
/// Share of the distance that must have passed.
const DISTANCE_SHARE: f64 = 0.9;

/// Limits of the rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trigger {
    /// Time between exposures, s; 0 = any.
    period_s: f64,
    /// Distance between exposures, m; 0 = any.
    distance_m: f64,
}

/// Exposures after the rule.
pub(crate) struct ThinnedFrames {
    /// The exposures that pass.
    pub kept: Vec<Frame>,
    /// Number of the others.
    pub n_skipped: u64,
}

impl Trigger {
    /// A rule with the largest rate, Hz, and the least distance between exposures, m; 0 = no limit.
    pub fn new(hz: f64, distance_m: f64) -> Self {
        Self { period_s: if hz > 0.0 { 1.0 / hz } else { 0.0 }, distance_m }
    }

    /// Applies the rule to the exposures of each camera separately.
    pub(crate) fn thin_out(&self, frames: &[Frame], odometer: &Odometer) -> ThinnedFrames {
        let mut last_of: BTreeMap<usize, Stamp> = BTreeMap::new();
        let passes = |frame: &&Frame| {
            let passes = last_of.get(&frame.camera).is_none_or(|last| self.is_due(*last, frame.stamp, odometer));
            if passes {
                last_of.insert(frame.camera, frame.stamp);
            }
            passes
        };
        let kept: Vec<Frame> = frames.iter().filter(passes).cloned().collect();
        let n_skipped = (frames.len() - kept.len()) as u64;
        ThinnedFrames { kept, n_skipped }
    }

    /// Whether an exposure passes the rule, given the last exposure that passed.
    pub(crate) fn is_due(&self, last: Stamp, stamp: Stamp, odometer: &Odometer) -> bool {
        let in_time = stamp.seconds_since(last) >= PERIOD_SHARE * self.period_s;
        // Without a fix the vehicle may have moved.
        in_time && odometer.between(last, stamp).is_none_or(|distance_m| distance_m >= DISTANCE_SHARE * self.distance_m)
    }
}

#[cfg(test)]
mod tests {
    use super::super::odometer::tests::fixes;
    use super::*;
    use std::path::PathBuf;

    fn frames(cameras: usize, hz: i64, seconds: i64) -> Vec<Frame> {
        let frame = |i: i64, camera: usize| Frame {
            stamp: Stamp(250_000_000 + i * 1_000_000_000 / hz),
            camera,
            path: PathBuf::new(),
        };
        (0..seconds * hz).flat_map(|i| (0..cameras).map(move |camera| frame(i, camera))).collect()
    }

    fn seconds(frames: &[Frame]) -> Vec<f64> {
        frames.iter().map(|frame| frame.stamp.0 as f64 / 1e9).collect()
    }

    #[test]
    fn free_running_cameras_are_thinned_out() {
        // The vehicle stands for three seconds, then drives at 5 m/s.
        let speeds: Vec<f64> = (0..12).map(|s| if s < 4 { 0.0 } else { 5.0 }).collect();
        let odometer = Odometer::new(&fixes(&speeds));
        let ThinnedFrames { kept, n_skipped } = Trigger::new(1.0, 1.0).thin_out(&frames(2, 10, 10), &odometer);
        let camera_1: Vec<Frame> = kept.iter().filter(|frame| frame.camera == 1).cloned().collect();
        assert_eq!(kept.len(), camera_1.len() * 2);
        assert_eq!(n_skipped as usize, 200 - kept.len());
        // The ramp from 0 to 5 m/s passes 0.9 m at 3.6 s.
        let times = seconds(&camera_1);
        assert_eq!(times[..2], [0.25, 3.65]);
        assert!(times.len() > 5, "{times:?}");
        assert!(times.windows(2).skip(1).all(|pair| (pair[1] - pair[0] - 1.0).abs() < 1e-6), "{times:?}");
    }

    #[test]
    fn triggered_recording_passes_unchanged() {
        let odometer = Odometer::new(&fixes(&[1.0; 12]));
        let mut triggered = frames(1, 1, 10);
        for (i, frame) in triggered.iter_mut().enumerate() {
            frame.stamp = frame.stamp.plus_nanos(if i % 2 == 0 { 20_000_000 } else { -20_000_000 });
        }
        let ThinnedFrames { kept, n_skipped } = Trigger::new(1.0, 1.0).thin_out(&triggered, &odometer);
        assert_eq!((kept, n_skipped), (triggered, 0));
    }

    #[test]
    fn trigger_without_fixes_uses_time_only_and_zero_disables_a_limit() {
        let none = Odometer::new(&[]);
        let still = Odometer::new(&fixes(&[0.0; 12]));
        let all = frames(1, 10, 10);
        assert_eq!(Trigger::new(1.0, 1.0).thin_out(&all, &none).kept.len(), 10);
        assert_eq!(Trigger::new(1.0, 0.0).thin_out(&all, &still).kept.len(), 10);
        assert_eq!(Trigger::new(0.0, 1.0).thin_out(&all, &still).kept.len(), 1);
        let untouched = Trigger::new(0.0, 0.0).thin_out(&all, &still);
        assert_eq!((untouched.kept, untouched.n_skipped), (all, 0));
    }
}
