//! Exposures that a submap may still need, borrowed from shared memory.

use messages::{CubeTopic, ImageTopic, Message};
use stage::Received;

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

/// Exposures in the order of (stamp, camera), at most [`Message::BORROWED`] between two steps.
pub struct Window<T: ExposureTopic>(Vec<Received<T>>);

impl<T: ExposureTopic> Default for Window<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: ExposureTopic> Window<T> {
    /// Adds an exposure.
    pub fn add(&mut self, exposure: Received<T>) {
        let key = |exposure: &Received<T>| (exposure.stamp(), T::camera(exposure.header()));
        let place = self.0.partition_point(|kept| key(kept) <= key(&exposure));
        self.0.insert(place, exposure);
    }
    /// All exposures.
    pub fn exposures(&self) -> &[Received<T>] {
        &self.0
    }
    /// Releases the exposures before `stamp`.
    pub fn release_before(&mut self, stamp: i64) {
        self.0.drain(..self.0.partition_point(|kept| kept.stamp() < stamp));
    }
    /// Releases the oldest exposures until the rest may be held after the step. Returns the number of released ones.
    pub fn release_excess(&mut self) -> u64 {
        let n_excess = self.0.len().saturating_sub(T::BORROWED);
        self.0.drain(..n_excess);
        n_excess as u64
    }
}
