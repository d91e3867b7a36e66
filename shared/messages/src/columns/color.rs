//! Topic `color`: the color of every point, from the cameras.

use super::COLUMN_QUEUE;
use crate::{Message, SubmapTopic, pod};

/// [`ColorRow::camera`] of a point that no exposure saw.
pub const UNSEEN: u8 = 255;

pod! {
    /// Color of one point, 4 bytes.
    pub struct ColorRow {
        /// sRGB red.
        pub r: u8,
        /// sRGB green.
        pub g: u8,
        /// sRGB blue.
        pub b: u8,
        /// Camera of the rig that saw the point; [`UNSEEN`] if none did, then r g b are 0.
        pub camera: u8,
    }
}
pod! {
    /// How many points of the submap have a color.
    pub struct ColorHeader { /// Points with a color.
        pub n_seen: u64 }
}

/// Color of every point.
pub struct ColorTopic;
impl Message for ColorTopic {
    const TOPIC: &'static str = "color";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = ColorHeader;
    type Row = ColorRow;
}
