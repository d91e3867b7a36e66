//! Turns submaps and their columns into the files of a result (`docs/explanation/georeferencing.md`).
//!
//! | idea | module |
//! |---|---|
//! | the files of one submap | `submap_files`: `submap_cloud` with `submap_geometry`, `spectra` |
//! | the final frame and the poses of the submaps in it | [`World`], `deviations` |
//! | moving clouds and trajectory to the final frame | `place`, `coordinates`, `frame`, `corrected` |
//! | the output folder: names, leftovers of earlier runs, index | [`Folder`], [`Index`] |
//! | space that the clouds of a drive will take | `space` |
//! | syncing clouds to the disk | `disk_sync` |
//!
//! The caller joins submaps and columns, decides when a cloud is written and reports doubts.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

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
pub use submap_cloud::{CloudFields, ReceivedSubmap};
pub use submap_files::write_submap;
pub use world::{FrameChoice, PlacedSubmap, World};
