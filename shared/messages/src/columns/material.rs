//! Topic `material`: the material of every point, by its spectrum.

use super::COLUMN_QUEUE;
use crate::{Message, SubmapTopic, pod};

pod! {
    /// Material of one point, 2 bytes.
    pub struct MaterialRow {
        /// [`crate::MaterialId`] code, 0 to 13.
        pub material_id: u8,
        /// Confidence, 0 to 255 for 0 to 1.
        pub score: u8,
    }
}
pod! {
    /// How many points of the submap have a material.
    pub struct MaterialHeader {
        /// [`crate::MATERIAL_TABLE_VERSION`].
        pub material_table_version: u64,
        /// Points with a material other than unknown.
        pub n_known: u64,
    }
}

/// Material of every point, by its spectrum; unknown for points without a spectrum.
pub struct MaterialTopic;
impl Message for MaterialTopic {
    const TOPIC: &'static str = "material";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = MaterialHeader;
    type Row = MaterialRow;
}
