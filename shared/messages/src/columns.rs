//! Columns of a submap: numbers of every point, each declared once.
//!
//! A column has the same length and order as the points of its submap; its envelope's seq is the seq of the submap.
//! [`COLUMNS`] lists for each column its topic, its fields, and how they look in files: property of PLY clouds, extra
//! byte of LAS records, unit, value for "none", description. `export`, `delivery`, `surveying`, pictures, the viewer, the
//! Python package and the test bench iterate over it.
//!
//! To add a column:
//!
//! 1. Write its payload type: a file next to `region.rs`, with [`Message`] for the topic.
//! 2. Write its entry in `table.rs`.
//!
//! Then `REPLICA_WRITE_DOCS=1 cargo test -p replica-tests --test suite column_pages` writes it into the pages under `docs/reference`.
//! `tests/suite/added_column.rs` adds a column by these steps and finds it in every kind of file.

mod class;
mod color;
mod column;
mod field;
mod instance;
mod material;
mod region;
mod spectra;
mod table;

pub use class::{ClassHeader, ClassRow, ClassTopic};
pub use color::{ColorHeader, ColorRow, ColorTopic, UNSEEN};
pub use column::{Column, ColumnVisitor, Presence};
pub use field::{ColumnField, ExtraByte, FieldType, NamedIds, Shown};
pub use instance::{InstanceHeader, InstanceTopic, MAX_MOVING_INSTANCES};
pub use material::{MaterialHeader, MaterialRow, MaterialTopic};
pub use region::{RegionHeader, RegionTopic};
pub use spectra::{MAX_BANDS, NO_SPECTRUM, SpectraHeader, SpectraTopic, SpectraView};
pub use table::{COLUMNS, visit_columns};

use crate::{Message, SubmapTopic};

/// Columns that may be published in one tick: the last tick has the columns of the held submap and of the submaps that
/// arrive.
const COLUMN_QUEUE: usize = SubmapTopic::QUEUE + 1;
