//! LAS and LAZ 1.4 files (ASPRS, LAS Specification 1.4 R15), point format 7.
//!
//! The crate laz provides the compression. The crate las would add chrono and uuid for a header of one page, and keeps
//! points in its own form; records here are encoded once and then copied.

mod extra_bytes;
mod file;
mod header;
mod record;
mod vlr;

pub(crate) use extra_bytes::{ExtraBytes, ExtraField};
pub(crate) use file::{Extent, LasFile, compressed_chunk, io_error, laz_vlr};
pub(crate) use header::{HEADER_BYTES, HeaderFacts, LasHeader};
pub(crate) use record::{
    RecordLayout, RecordSource, SCALE_M, color_of, gps_time_of, is_withheld, position_of, source_of, withhold,
};
pub(crate) use vlr::{Vlr, evlr_bytes};

/// Bytes of a record of point format 7 before the extra bytes.
pub(crate) const FORMAT_7_BYTES: usize = 36;
