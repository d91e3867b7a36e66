//! Exposures that a submap may still need.

use geometry::{Pose, Stamp, Trajectory};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Counts of received and unused exposures of one camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExposureTally {
    /// All exposures received.
    pub received: u64,
    /// Exposures that do not match the rig.
    pub unusable: u64,
    /// Exposures before the first or after the last pose.
    pub without_pose: u64,
}

impl ExposureTally {
    /// Share of exposures that could not be used.
    pub fn unused_share(&self) -> f64 {
        (self.unusable + self.without_pose) as f64 / self.received.max(1) as f64
    }
}

/// An exposure of a window.
pub struct HeldExposure<T> {
    /// Middle of the exposure, ns since the Unix epoch.
    pub stamp: i64,
    /// Index of the camera.
    pub camera: u32,
    /// Its pixels.
    pub data: T,
}

/// Exposures ordered by (stamp, camera).
pub struct ExposureWindow<T> {
    held: Vec<HeldExposure<T>>,
    /// Counts by camera index.
    tallies: BTreeMap<u32, ExposureTally>,
}

/// A held exposure with the pose of the body at its stamp.
#[derive(Clone, Copy, Debug)]
pub struct HeldWithPose<'a, T> {
    /// Data of the exposure.
    pub data: &'a T,
    /// Pose of the body at its stamp.
    pub odom_from_body: Pose,
}

/// Exposures of a time range.
#[derive(Clone, Debug)]
pub struct ExposuresInRange<'a, T> {
    /// Exposures with a pose.
    pub exposures: Vec<HeldWithPose<'a, T>>,
    /// Number of exposures without a pose.
    pub n_without_pose: u64,
}

impl<T> Default for ExposureWindow<T> {
    fn default() -> Self {
        Self::with_tallies(BTreeMap::new())
    }
}

impl<T> ExposureWindow<T> {
    /// Continues with the counts of a saved state; see [`ExposureWindow::restore`].
    pub fn with_tallies(tallies: BTreeMap<u32, ExposureTally>) -> Self {
        Self { held: Vec::new(), tallies }
    }
    /// Adds an exposure that was counted before the state was saved.
    pub fn restore(&mut self, exposure: HeldExposure<T>) {
        let key = |exposure: &HeldExposure<T>| (exposure.stamp, exposure.camera);
        let place = self.held.partition_point(|kept| key(kept) <= key(&exposure));
        self.held.insert(place, exposure);
    }
    /// Adds an exposure.
    pub fn add(&mut self, exposure: HeldExposure<T>) {
        self.tallies.entry(exposure.camera).or_default().received += 1;
        self.restore(exposure);
    }
    /// Counts an exposure that does not match the rig.
    pub fn refuse(&mut self, camera: u32) {
        let tally = self.tallies.entry(camera).or_default();
        tally.received += 1;
        tally.unusable += 1;
    }
    /// All exposures.
    pub fn exposures(&self) -> &[HeldExposure<T>] {
        &self.held
    }
    /// The exposures with a stamp in `stamps`.
    pub fn within(&self, stamps: RangeInclusive<i64>) -> &[HeldExposure<T>] {
        let first = self.held.partition_point(|kept| kept.stamp < *stamps.start());
        let end = self.held.partition_point(|kept| kept.stamp <= *stamps.end());
        self.held.get(first..end).unwrap_or_default()
    }
    /// The exposures with a stamp in `stamps`.
    pub fn posed_within(&self, stamps: RangeInclusive<i64>, trajectory: &Trajectory) -> ExposuresInRange<'_, T> {
        let near = self.within(stamps);
        let posed = |held: &HeldExposure<T>| trajectory.at(Stamp(held.stamp));
        let exposures: Vec<HeldWithPose<'_, T>> = near
            .iter()
            .filter_map(|held| Some(HeldWithPose { data: &held.data, odom_from_body: posed(held)? }))
            .collect();
        let n_without_pose = (near.len() - exposures.len()) as u64;
        ExposuresInRange { exposures, n_without_pose }
    }
    /// Stamp of the oldest exposure.
    pub fn oldest_stamp(&self) -> Option<i64> {
        self.held.first().map(|exposure| exposure.stamp)
    }
    /// Counts by camera index.
    pub fn tallies(&self) -> &BTreeMap<u32, ExposureTally> {
        &self.tallies
    }
    /// Releases the exposures before `stamp`. `has_pose` returns whether the trajectory has a pose at a stamp.
    pub fn release_before(&mut self, stamp: i64, has_pose: impl Fn(i64) -> bool) {
        self.release(self.held.partition_point(|kept| kept.stamp < stamp), has_pose);
    }
    /// Releases the oldest exposures until at most `n_max` are left. Returns the number of released exposures.
    pub fn release_excess(&mut self, n_max: usize, has_pose: impl Fn(i64) -> bool) -> u64 {
        let n_excess = self.held.len().saturating_sub(n_max);
        self.release(n_excess, has_pose);
        n_excess as u64
    }
    /// Releases all exposures.
    pub fn release_all(&mut self, has_pose: impl Fn(i64) -> bool) {
        self.release(self.held.len(), has_pose);
    }
    fn release(&mut self, n: usize, has_pose: impl Fn(i64) -> bool) {
        for exposure in self.held.drain(..n).filter(|exposure| !has_pose(exposure.stamp)) {
            self.tallies.entry(exposure.camera).or_default().without_pose += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(stamps: &[i64]) -> ExposureWindow<()> {
        let mut window = ExposureWindow::default();
        for &stamp in stamps {
            window.add(HeldExposure { stamp, camera: 0, data: () });
        }
        window
    }

    #[test]
    fn exposures_within_a_time_include_both_ends() {
        let window = window(&[5, 1, 3, 3, 9]);
        let within = |stamps| window.within(stamps).iter().map(|held| held.stamp).collect::<Vec<i64>>();
        assert_eq!(within(3..=5), [3, 3, 5]);
        assert_eq!(within(6..=8), [] as [i64; 0]);
        assert_eq!(within(i64::MIN..=i64::MAX), [1, 3, 3, 5, 9]);
    }

    #[test]
    fn exposures_are_tallied_when_released_without_a_pose() {
        let mut window = window(&[1, 3, 5, 9]);
        window.refuse(0);
        window.release_before(4, |stamp| stamp != 1);
        assert_eq!(window.release_excess(1, |_| true), 1);
        window.release_all(|_| false);
        assert_eq!(window.tallies()[&0], ExposureTally { received: 5, unusable: 1, without_pose: 2 });
        assert_eq!(window.oldest_stamp(), None);
    }
}
