//! PLY point clouds (Turk 1994): a text header, then one row per point.
//!
//! Written: binary little-endian, one `vertex` element, scalars only. `Open3D` skips `char short ushort uint`, and the reader of
//! `KPConv` fails on keywords inside comments, so [`Header`] allows neither.
//! Read: every scalar type in ASCII and both byte orders. Other elements and lists are skipped.
//!
//! ply-rs reads and writes all headers and decodes all files except plain binary ones. Rows of plain binary files are
//! encoded and decoded here, because ply-rs builds a map of values for each row.

mod camera;
mod cloud;
mod error;
mod header;
mod kind;
mod packed;
mod reader;
mod row;
mod rows;
mod writer;

pub use error::{HeaderFault, PayloadFault, PlyError, PropertyFault, RowMismatch, UnwritableHeader};
pub use header::{Header, Property};
pub use kind::Kind;
pub use reader::Vertices;
pub use row::Row;
pub use rows::PlyRows;
pub use writer::PlyWriter;
