//! Topic `region`: the region of equal spectra in which every point lies.

use super::COLUMN_QUEUE;
use crate::{Message, SubmapTopic, pod};

pod! {
    /// How many points of the submap have a region.
    pub struct RegionHeader { /// Points with a region.
        pub n_points: u64 }
}

/// Region of the cell in which a mosaic camera saw each point: 0 = none. A region is the set of cells that belong to one
/// Gaussian of a model of the camera's cubes; its number occurs in no other model of the run. With several cameras, the
/// first camera with a region for the point is used.
pub struct RegionTopic;
impl Message for RegionTopic {
    const TOPIC: &'static str = "region";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = RegionHeader;
    type Row = u32;
}
