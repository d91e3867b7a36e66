//! PLY point clouds (Turk 1994): a text header, then one row per point.
//!
//! Written: binary little-endian, one `vertex` element, scalars only. `Open3D` skips `char short ushort uint` and `KPConv`'s
//! reader trips over the words of the header's grammar inside comments, so [`Header`] allows neither.
//! Read: every scalar type in ASCII and both byte orders; other elements and lists are passed over.

mod error;
mod header;
mod odd;
mod reader;
mod row;
mod rows;
mod writer;

pub use error::PlyError;
pub use header::{Header, Kind, Property};
pub use reader::Vertices;
pub use row::Row;
pub use rows::PlyRows;
pub use writer::PlyWriter;
