//! A column: the fields that come together on one topic.

use super::ColumnField;
use crate::{ByteTable, Message};
use serde::Serialize;

/// Fields of every point that are present together, and the topic on which they come.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Column {
    /// Name of the column: its topic, or its content if the topic is `submap`.
    pub name: &'static str,
    /// [`Message::TOPIC`].
    pub topic: &'static str,
    /// Layout of the topic's messages.
    #[serde(skip)]
    pub layout: fn() -> ByteTable,
    /// Runs that have the column.
    pub presence: Presence,
    /// Place among the columns of PLY clouds. A new column takes the next number, so that rows keep their layout.
    pub place: u8,
    /// Its fields in the order of PLY rows. Empty for spectra, which have files of their own.
    pub fields: &'static [ColumnField],
    /// Lines `obj_info` in the header of PLY clouds, in addition to names of values.
    pub header_lines: &'static [&'static str],
    /// Content of the column, in plain words.
    pub description: &'static str,
}

/// Runs that have a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Presence {
    /// All runs.
    Always,
    /// Runs with several LiDARs.
    SeveralLidars,
    /// Runs with a stage that publishes it, as stages do by default. `export` notes its absence.
    Default,
    /// Runs with this setting.
    Setting(&'static str),
}

/// Receives the type of each column's topic, which the table itself cannot name.
pub trait ColumnVisitor {
    /// Called for each column that has a topic of its own.
    fn visit<T: Message>(&mut self, column: &'static Column);
}

impl Column {
    /// Whether the column has a topic of its own and is not part of the points.
    pub fn has_own_topic(&self) -> bool {
        self.topic != crate::SubmapTopic::TOPIC
    }

    /// Bytes before a field in the row of the topic.
    ///
    /// # Panics
    ///
    /// If the row has no such field; a test of the table checks its entries.
    pub fn offset_in_row(&self, field: &ColumnField) -> usize {
        let layout = (self.layout)();
        let found = layout.row.iter().find(|row| row.name == field.row_field);
        found.unwrap_or_else(|| panic!("rows of {} have no field {:?}", self.topic, field.row_field)).offset
    }
}
