//! How many rings each LiDAR of a vehicle has.

use crate::MAX_LIDARS;

/// Rings by index of the LiDAR; 0 for LiDARs without rings or without points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RingCounts([u32; MAX_LIDARS]);

impl RingCounts {
    /// Counts of the first LiDAR and of the other LiDARs.
    pub fn new(first: u32, others: [u32; MAX_LIDARS - 1]) -> Self {
        let mut counts = [first; MAX_LIDARS];
        counts[1..].copy_from_slice(&others);
        Self(counts)
    }

    /// Rings of a LiDAR.
    pub fn get(&self, lidar: u32) -> u32 {
        self.0.get(lidar as usize).copied().unwrap_or(0)
    }
}

impl From<u32> for RingCounts {
    /// Counts of a vehicle with a single LiDAR.
    fn from(first: u32) -> Self {
        Self::new(first, [0; MAX_LIDARS - 1])
    }
}
