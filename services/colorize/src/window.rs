//! Exposures that a submap may still need, borrowed from shared memory.

use messages::{CubeTopic, ImageTopic, Message};
use serde::{Deserialize, Serialize};
use stage::Received;
use std::collections::BTreeMap;

/// A topic of exposures.
pub trait ExposureTopic: Message {
    /// Index of the camera.
    fn camera(header: &Self::Header) -> u32;
}

impl ExposureTopic for ImageTopic {
    fn camera(header: &Self::Header) -> u32 {
        header.camera
    }
}

impl ExposureTopic for CubeTopic {
    fn camera(header: &Self::Header) -> u32 {
        header.camera
    }
}

/// What became of the exposures of one camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tally {
    /// All that arrived.
    pub received: u64,
    /// Those that do not match the rig.
    pub unusable: u64,
    /// Those before the first or after the last pose.
    pub without_pose: u64,
}

impl Tally {
    /// Share of exposures that could not be used.
    pub fn unused_share(&self) -> f64 {
        (self.unusable + self.without_pose) as f64 / self.received.max(1) as f64
    }
}

/// Exposures in the order of (stamp, camera), at most [`Message::BORROWED`] between two steps.
pub struct Window<T: ExposureTopic> {
    held: Vec<Received<T>>,
    /// By camera.
    tallies: BTreeMap<u32, Tally>,
}

impl<T: ExposureTopic> Default for Window<T> {
    fn default() -> Self {
        Self { held: Vec::new(), tallies: BTreeMap::new() }
    }
}

impl<T: ExposureTopic> Window<T> {
    /// From a saved state; see [`Window::restore`].
    pub fn with_tallies(tallies: BTreeMap<u32, Tally>) -> Self {
        Self { held: Vec::new(), tallies }
    }
    /// Adds an exposure that was counted before the state was saved.
    pub fn restore(&mut self, exposure: Received<T>) {
        let key = |exposure: &Received<T>| (exposure.stamp(), T::camera(exposure.header()));
        let place = self.held.partition_point(|kept| key(kept) <= key(&exposure));
        self.held.insert(place, exposure);
    }
    /// Adds an exposure.
    pub fn add(&mut self, exposure: Received<T>) {
        self.tallies.entry(T::camera(exposure.header())).or_default().received += 1;
        self.restore(exposure);
    }
    /// Counts an exposure that does not match the rig.
    pub fn refuse(&mut self, exposure: &Received<T>) {
        let tally = self.tallies.entry(T::camera(exposure.header())).or_default();
        tally.received += 1;
        tally.unusable += 1;
    }
    /// All exposures.
    pub fn exposures(&self) -> &[Received<T>] {
        &self.held
    }
    /// By camera.
    pub fn tallies(&self) -> &BTreeMap<u32, Tally> {
        &self.tallies
    }
    /// Releases the exposures before `stamp`. `has_pose`: whether the trajectory has a pose at a stamp.
    pub fn release_before(&mut self, stamp: i64, has_pose: impl Fn(i64) -> bool) {
        self.release(self.held.partition_point(|kept| kept.stamp() < stamp), has_pose);
    }
    /// Releases the oldest exposures until the rest may be held after the step. Returns the number of released ones.
    pub fn release_excess(&mut self, has_pose: impl Fn(i64) -> bool) -> u64 {
        let n_excess = self.held.len().saturating_sub(T::BORROWED);
        self.release(n_excess, has_pose);
        n_excess as u64
    }
    /// Releases all exposures.
    pub fn release_all(&mut self, has_pose: impl Fn(i64) -> bool) {
        self.release(self.held.len(), has_pose);
    }
    fn release(&mut self, n: usize, has_pose: impl Fn(i64) -> bool) {
        for exposure in self.held.drain(..n).filter(|exposure| !has_pose(exposure.stamp())) {
            self.tallies.entry(T::camera(exposure.header())).or_default().without_pose += 1;
        }
    }
}
