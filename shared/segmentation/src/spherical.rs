//! Segmentation with range images (thesis section 6.3.2): a network on the image of each sweep, back-projection to its points,
//! and votes of all sweeps of a submap.

pub mod back_projection;
mod camera_columns;
mod coarse_azimuths;
mod elementary;
mod feature;
mod feature_tiles;
mod features;
mod image_refinement;
mod model;
mod named_features;
mod nearest_examples;
mod polar_image;
mod range_sweep;
mod settings;
mod softmax;
mod submap_sweeps;
mod surface;
mod sweep_images;
mod votes;

pub use camera_columns::BAND_REACH_NM;
pub use feature::{AskedColumns, CameraBand, Feature, Features, N_FEATURES};
pub use features::features;
pub use model::{LoadedModel, SphericalModel};
pub use nearest_examples::{ColumnExamples, NearestSettings};
pub use polar_image::{PolarImage, PolarPixel};
pub use range_sweep::{ImageSource, RangeSweep, range_sweeps};
pub use settings::{ARCHITECTURE, GroundUse, Settings, VERSION};
pub use softmax::{MAX_CLASSES, Vote};
pub use submap_sweeps::{OwnedSpectra, OwnedSubmap, SegmentedSubmap, SubmapSweeps};
pub use sweep_images::{LoadedImages, SweepImages};
