//! The files that a run writes while it runs: clouds of submaps, their index, the trajectory and their frame.
//!
//! `export` is a thin stage over this crate. The crate `surveying` reads these files and converts a finished run to
//! surveying formats (LAS, COPC, GeoTIFF).
//!
//! | idea | module |
//! |---|---|
//! | the files of one submap | `submap_files`: `submap_cloud` with `submap_geometry`, `spectra` |
//! | properties and header lines of clouds from the table of columns | `cloud_columns` |
//! | the final frame and the poses of the submaps in it | [`World`], `deviations` |
//! | moving clouds and trajectory to the final frame | `place`, `coordinates`, `frame`, `corrected` |
//! | the output folder: names, leftovers of earlier runs, index | [`Folder`], [`Index`] |
//! | space that the clouds of a drive will take | `space` |
//! | syncing clouds to the disk | `disk_sync` |
//!
//! The caller joins submaps and columns, decides when a cloud is written and reports doubts.
//!
//! This crate must never wait for messages, depend on a stage, or name a column that the table ([`messages::columns`])
//! declares, except where the index counts its values. It must not change a cloud in place: a cloud is written to a copy
//! that replaces it when complete, so that a run killed at any time can continue. The same submaps give the same bytes
//! for any number of threads.
//!
//! Start reading with `submap_files.rs` (how a cloud is written), then `place.rs` (how it is moved to the final frame;
//! `docs/explanation/georeferencing.md` explains why).

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod cloud_columns;
mod coordinates;
mod corrected;
mod deviations;
mod disk_sync;
mod error;
mod folder;
mod frame;
mod georeference;
mod index;
mod place;
mod space;
mod spectra;
mod submap_cloud;
mod submap_files;
mod submap_geometry;
mod world;

pub use cloud_columns::{CloudColumn, CloudFields, ply_kind};
pub use corrected::corrected;
pub use deviations::{Deviations, MedianAndLargest};
pub use disk_sync::{sync, sync_in_background};
pub use error::DeliveryError;
pub use folder::{CLOUDS, Folder, GEOREFERENCE, INDEX, submap_of};
pub use frame::is_in_odometry;
pub use georeference::{GeoreferenceFile, Uses, UtmOrigin};
pub use index::{CloudEntry, Index, SpectraEntry};
pub use place::move_clouds;
pub use space::{SpaceNeed, space_need};
pub use submap_cloud::{ReceivedColumn, ReceivedSubmap};
pub use submap_files::write_submap;
pub use world::{FrameChoice, PlacedSubmap, World};
