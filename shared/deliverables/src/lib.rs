//! Deliverables: a finished run in the formats that surveyors and other programs read (`docs/reference/deliverables.md`).
//!
//! | idea | module |
//! |---|---|
//! | what a run has written | [`RunFolder`], `cloud` |
//! | coordinate reference systems, heights, local frame | `crs`, [`TargetFrame`] |
//! | classes of the ASPRS | `asprs` |
//! | bytes of LAS and LAZ | `las` |
//! | points by tile or node, in bounded memory | `cloud_delivery`, `spool`, `tiles`, `copc` |
//!
//! The same run and options give the same bytes, for any number of threads. Memory does not grow with the length of the drive: records
//! wait in a temporary file in the folder of the delivery.

mod asprs;
mod cloud;
mod cloud_delivery;
mod copc;
pub mod crs;
mod error;
mod las;
mod path_heading;
mod run_folder;
mod spool;
mod target_frame;
mod tiles;

pub use asprs::asprs_class;
pub use cloud_delivery::{CloudOptions, LeftOut};
pub use copc::write_copc;
pub use error::DeliverError;
pub use run_folder::{Georeference, RunFolder};
pub use target_frame::TargetFrame;
pub use tiles::{PointFile, Tiling, write_tiles};
