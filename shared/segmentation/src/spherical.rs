//! Segmentation with range images (thesis section 6.3.2): a network on the image of each sweep, back-projection to its points,
//! and votes of all sweeps of a submap.

pub mod back_projection;
mod camera_columns;
mod coarse_azimuths;
mod elementary;
mod feature;
mod features;
mod intensity;
mod model;
mod named_features;
mod options;
mod pixel_classifier;
mod polar_image;
mod range_sweep;
mod refinement;
mod ring_gains;
mod settings;
mod softmax;
mod submap_sweeps;
mod surface;
mod sweep_images;
mod votes;

pub use camera_columns::BAND_REACH_NM;
pub use feature::{AskedColumns, CameraBand, Feature, Features};
pub use features::{N_FEATURES, features};
pub use intensity::{GroundHistogram, GroundIntensities, IntensityMap, IntensityUse};
pub use model::SphericalModel;
pub use options::Options;
pub use pixel_classifier::PixelClassifier;
pub use polar_image::{PolarImage, PolarPixel};
pub use range_sweep::{ImageSource, RangeSweep, range_sweeps};
pub use refinement::Refinement;
pub use ring_gains::GroundByRing;
pub use settings::{ARCHITECTURE, GroundUse, Settings, VERSION};
pub use softmax::{MAX_CLASSES, Vote};
pub use submap_sweeps::{OwnedSubmap, SubmapSweeps};
pub use sweep_images::SweepImages;
