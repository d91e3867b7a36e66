//! Mosaic hyperspectral cameras: raw frames to reflectance, and reflectance to cubes (thesis 2.5.1).
//!
//! A mosaic camera has one band filter per pixel, repeated every `P x P` pixels.
//!
//! - [`Mosaic`] is the geometry of the filters.
//! - [`Reference`] averages dark frames and white references.
//! - [`Calibration`] converts raw frames to reflectance, per pixel or binned by pattern cell into a band-sequential cube.
//! - [`Demosaicer`] interpolates every band at every pixel; [`FullResolution`] computes whole cubes with it.
//! - [`Correction`] converts the bands of the filters to virtual bands with one peak each.
//!
//! Start reading at [`Calibration`], whose documentation has the formula, then [`Camera`], which combines all steps for
//! one camera of a drive.
//!
//! Reflectances are shares of the incoming light: 0 is black, and the white reference has its stated reflectance. Wavelengths are in nm,
//! exposures in ns, raw samples in counts.
//!
//! The crate must never hide a bad sample: a saturated, clipped or dead pixel is masked and counted, not replaced, and
//! the virtual bands of a cell with a masked band are also masked. The crate uses no clocks, threads and files, except
//! [`Camera`], which reads the references of a drive.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod calibration;
mod camera;
mod correction;
pub mod demosaic;
mod error;
mod full_resolution;
mod limits;
mod median;
mod mosaic;
mod planes;
mod reference;

pub use calibration::{Calibration, DarkReference, FrameCounts, PixelReflectances, WhitePanel, WhiteTarget};
pub use camera::{Camera, CameraError};
pub use correction::Correction;
pub use demosaic::{Demosaicer, Demosaicing, Resolution};
pub use error::SpectralError;
pub use full_resolution::FullResolution;
pub use limits::MAX_PATTERN;
pub use median::median_3x3;
pub use mosaic::Mosaic;
pub use reference::Reference;
