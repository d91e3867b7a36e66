//! Topic `instance`: the object to which every point belongs.

use super::COLUMN_QUEUE;
use crate::{Message, SubmapTopic, pod};

/// Most moving instances that a header names. A submap of a dense motorway has about 30.
pub const MAX_MOVING_INSTANCES: usize = 64;

pod! {
    /// Number of instances, and which of them move.
    pub struct InstanceHeader {
        /// Instances with at least one point in this submap.
        pub n_instances: u32,
        /// Points with an instance.
        pub n_points: u32,
        /// Number of ids in `moving`, at most [`MAX_MOVING_INSTANCES`].
        pub n_moving: u32,
        /// Ids of the instances that change their place during this submap, increasing; 0 from `n_moving` on.
        pub moving: [u32; MAX_MOVING_INSTANCES],
    }
}

impl InstanceHeader {
    /// Names moving instances, in any order. The smallest [`MAX_MOVING_INSTANCES`] ids are kept.
    pub fn set_moving(&mut self, ids: impl IntoIterator<Item = u32>) {
        let ids: std::collections::BTreeSet<u32> = ids.into_iter().collect();
        self.moving = [0; MAX_MOVING_INSTANCES];
        self.moving.iter_mut().zip(&ids).for_each(|(place, id)| *place = *id);
        self.n_moving = ids.len().min(MAX_MOVING_INSTANCES) as u32;
    }

    /// Ids of the moving instances, increasing.
    pub fn moving(&self) -> &[u32] {
        &self.moving[..MAX_MOVING_INSTANCES.min(self.n_moving as usize)]
    }
}

/// Instance of every point: 0 = none; an id names the same object in every submap.
pub struct InstanceTopic;
impl Message for InstanceTopic {
    const TOPIC: &'static str = "instance";
    const VERSION: u32 = 2;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = InstanceHeader;
    type Row = u32;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moving_ids_are_sorted_and_bounded() {
        let mut header = InstanceHeader::default();
        header.set_moving([7, 3, 7]);
        assert_eq!(header.moving(), [3, 7]);
        header.set_moving((1..=100).rev());
        assert_eq!((header.moving().len(), header.moving()[63]), (64, 64));
        header.n_moving = u32::MAX;
        assert_eq!(header.moving().len(), MAX_MOVING_INSTANCES);
    }
}
