//! Lidar sweeps of simulated towns with the class of every point, simulated on demand. Models are trained and evaluated on them.

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

/// The kind of town of this name.
pub fn town_from_name(name: &str) -> Result<Town, TownSweepsError> {
    name.parse().map_err(|_| TownSweepsError::UnknownTown { name: name.to_owned() })
}
