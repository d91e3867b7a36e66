//! Mosaic hyperspectral cameras: raw frames into reflectance, and reflectance into cubes (thesis 2.5.1).
//!
//! A mosaic camera has one band filter per pixel, repeated every `P x P` pixels. [`Mosaic`] says where the filters lie,
//! [`Reference`] averages dark and white frames, [`Calibration`] turns raw frames into reflectance, per pixel or binned
//! by pattern cell into a band-sequential cube, [`Demosaicer`] brings every band to the
//! mosaic's full resolution ([`FullResolution`] whole cubes), [`Correction`] turns bands of filters into bands with one peak each. Numbers in, numbers out: no clock, no threads, and
//! files only in [`Camera`], which reads the references of a drive.

mod calibration;
mod camera;
mod correction;
pub mod demosaic;
mod error;
mod full_resolution;
mod median;
mod mosaic;
mod reference;

pub use calibration::{Calibration, FrameCounts, WhitePanel, WhiteTarget};
pub use camera::Camera;
pub use correction::Correction;
pub use demosaic::{Demosaicer, Demosaicing};
pub use error::SpectralError;
pub use full_resolution::FullResolution;
pub use median::median_3x3;
pub use mosaic::{MAX_PATTERN, Mosaic};
pub use reference::Reference;
