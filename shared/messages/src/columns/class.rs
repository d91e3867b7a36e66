//! Topic `class`: the class of every point.

use super::COLUMN_QUEUE;
use crate::{Message, SubmapTopic, pod};

pod! {
    /// Class of one point, 2 bytes.
    pub struct ClassRow {
        /// [`crate::ClassId`] code, 0 to 22.
        pub class_id: u8,
        /// Confidence, 0 to 255 for 0 to 1.
        pub score: u8,
    }
}
pod! {
    /// Source of the classes.
    pub struct ClassHeader {
        /// [`crate::CLASS_TABLE_VERSION`].
        pub class_table_version: u64,
        /// First 8 bytes of the model file's digest.
        pub model_digest: u64,
    }
}

/// Class of every point.
pub struct ClassTopic;
impl Message for ClassTopic {
    const TOPIC: &'static str = "class";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = ClassHeader;
    type Row = ClassRow;
}
