//! Exposures that a submap may still need, borrowed from shared memory.

use messages::{Cube, Image, Message};
use stage::Received;

/// A topic of exposures.
pub trait Exposure: Message {
    /// Index of the camera.
    fn camera(header: &Self::Header) -> u32;
}

impl Exposure for Image {
    fn camera(header: &Self::Header) -> u32 {
        header.camera
    }
}

impl Exposure for Cube {
    fn camera(header: &Self::Header) -> u32 {
        header.camera
    }
}

/// In the order of (stamp, camera), at most [`Message::BORROWED`] between two steps.
pub struct Window<T: Exposure>(Vec<Received<T>>);

impl<T: Exposure> Default for Window<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Exposure> Window<T> {
    /// Takes an exposure in.
    pub fn add(&mut self, exposure: Received<T>) {
        let key = |exposure: &Received<T>| (exposure.stamp(), T::camera(exposure.header()));
        let place = self.0.partition_point(|kept| key(kept) <= key(&exposure));
        self.0.insert(place, exposure);
    }
    /// All of them.
    pub fn exposures(&self) -> &[Received<T>] {
        &self.0
    }
    /// Lets go of what is before `stamp`.
    pub fn release_before(&mut self, stamp: i64) {
        self.0.drain(..self.0.partition_point(|kept| kept.stamp() < stamp));
    }
    /// Lets go of the oldest until the rest may be kept over the step's end. Says how many had to go.
    pub fn release_excess(&mut self) -> u64 {
        let n_excess = self.0.len().saturating_sub(T::BORROWED);
        self.0.drain(..n_excess);
        n_excess as u64
    }
}
