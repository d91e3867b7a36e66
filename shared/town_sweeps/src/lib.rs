//! LiDAR sweeps of simulated towns with the class of every point, simulated on demand. Models are trained and evaluated on them.
//!
//! Start reading at [`TownDrive`]: a kind of town, a seed and a length. [`TownDrive::submaps`] returns submaps in the
//! form that the stage `infer` receives, with the true class and instance of every point, recorded from a [`Mount`].
//!
//! - [`IdealCamera`]: reflectances that a camera at the LiDAR would measure, without noise, light or occlusion
//! - [`MosaicCameras`]: spectra that the mosaic cameras of the rig measure, with noise, light and shadow
//! - [`true_surfaces`]: material and sunlight of the surface behind each point
//!
//! The crate must never let a class, an instance or a material influence a sensor measurement, and never use an unseeded
//! random number: the same drive, mount and step give the same points on every machine. Models are scored on towns with
//! other seeds than the training towns; the crate does not choose seeds.

mod drive;
mod error;
mod ideal_camera;
mod mosaic_cameras;
mod mount;
mod mount_name;
mod source;
mod submap;
mod surface_rays;

pub use drive::TownDrive;
pub use error::TownSweepsError;
pub use ideal_camera::{BANDS_NM, IdealCamera};
pub use mosaic_cameras::{MosaicCameras, PointSpectra};
pub use mount::Mount;
pub use submap::TownSubmap;
pub use surface_rays::{TrueSurface, true_surfaces};

use simulation::Town;

/// The kind of town with this name.
pub fn town_from_name(name: &str) -> Result<Town, TownSweepsError> {
    name.parse().map_err(|_| TownSweepsError::UnknownTown { name: name.to_owned() })
}
