//! Surveying: a finished run in the formats that surveyors and other programs read (`docs/reference/deliverables.md`).
//!
//! `replica deliver` is a thin command over this crate. It reads the files that the crate `delivery` wrote during the
//! run: clouds, their index, the trajectory and the frame.
//!
//! | idea | module |
//! |---|---|
//! | what a run has written, the drives of a survey | [`RunFolder`], [`SurveyFile`], `cloud` |
//! | coordinate reference systems, their datums and heights; local frame | [`crs`], [`TargetFrame`] |
//! | classes of the ASPRS | `asprs` |
//! | columns of a cloud by the table of columns, values of a point | `cloud::columns` |
//! | bytes of LAS and LAZ | `las` |
//! | points by tile or node, in bounded memory | `cloud_delivery`, `spool`, `tiles`, `copc` |
//! | points of a run that is not finished | [`GrowingCloud`] |
//! | path and objects | `trajectory`, [`objects`] |
//! | terrain and top views, contour lines of the terrain | `rasters`, `contours` |
//! | lines and areas as GeoJSON in coordinates of the delivery | `features` |
//! | the ground and what stays, as a caller has determined it | [`StaticWorld`] |
//! | residuals at points that were measured independently | [`check_points`] |
//! | accuracy at such points and between drives | [`accuracy`] |
//! | the delivery as an item of a catalog | `stac` |
//! | clouds for CloudCompare, sweeps for training | `cloudcompare`, `semantic_kitti` |
//!
//! This crate must never change the run that it reads, estimate or filter anything except contour lines, or shift between datums of
//! receivers: coordinates are converted, values are copied. It refers to no column by name unless a format gives it a meaning: the class of a LAS
//! record, the camera of a raster.
//!
//! Start reading with `tiles.rs` and `cloud_delivery.rs` (how points become records), then `target_frame.rs` (in which
//! coordinates).
//!
//! The same run and options give the same bytes, for any number of threads. Memory does not grow with the length of the
//! drive: records are buffered in a temporary file in the folder of the delivery.

pub mod accuracy;
mod asprs;
pub mod check_points;
mod cloud;
mod cloud_delivery;
mod cloudcompare;
mod contours;
mod copc;
pub mod crs;
mod error;
mod features;
mod geojson;
mod growing_cloud;
mod las;
pub mod objects;
mod path_heading;
mod rasters;
mod run_folder;
mod semantic_kitti;
mod spool;
mod stac;
mod static_world;
mod target_frame;
mod tiles;
mod trajectory;

pub use asprs::asprs_class;
pub use cloud::CloudPoint;
pub use cloud_delivery::{CloudOptions, LeftOut};
pub use cloudcompare::write_cloudcompare;
pub use contours::{CONTOURS, write_contours};
pub use copc::write_copc;
pub use error::DeliverError;
pub use features::{Line, write_lines};
pub use growing_cloud::{GrowingCloud, Part};
pub use rasters::{CellCounts, RasterOptions, WrittenRasters, write_rasters};
pub use run_folder::{
    AdjustedCloud, AdjustedDrive, Georeference, RunFolder, SURVEY, SurveyAccuracy, SurveyFile, load_trajectory,
    open_survey,
};
pub use semantic_kitti::write_semantic_kitti;
pub use spool::{KeyedRecords, Spool};
pub use stac::{STAC_ITEM, write_stac_item};
pub use static_world::{GroundSample, StaticWorld};
pub use target_frame::{MapChoice, TargetFrame};
pub use tiles::{PointFile, TILE_INDEX, Tiling, WrittenTiles, write_tiles};
pub use trajectory::write_trajectory;
