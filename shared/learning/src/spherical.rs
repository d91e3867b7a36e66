//! Segmentation of sweeps as range images: a network on each sweep's image, back-projection to its points, and the votes of
//! all sweeps of a submap (thesis section 6.3.2).

pub mod back_projection;
mod elementary;
mod features;
mod model;
mod neighbors;
mod polar_image;
mod refinement;
mod softmax;
mod surface;
mod sweeps;
mod votes;

pub use features::{FEATURES, N_FEATURES, features};
pub use model::{ARCHITECTURE, Settings, SphericalModel, VERSION};
pub use neighbors::Neighbors;
pub use polar_image::{PolarImage, PolarPixel};
pub use refinement::Refinement;
pub use sweeps::{Sweep, sweeps};
