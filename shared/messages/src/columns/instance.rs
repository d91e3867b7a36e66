//! Topic `instance`: the object to which every point belongs.

use super::COLUMN_QUEUE;
use crate::{Message, SubmapTopic, pod};

pod! {
    /// Number of instances.
    pub struct InstanceHeader {
        /// Instances with at least one point in this submap.
        pub n_instances: u32,
        /// Points with an instance.
        pub n_points: u32,
    }
}

/// Instance of every point: 0 = none; an id names the same object in every submap.
pub struct InstanceTopic;
impl Message for InstanceTopic {
    const TOPIC: &'static str = "instance";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = InstanceHeader;
    type Row = u32;
}
