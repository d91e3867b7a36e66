//! Mosaic hyperspectral cameras: raw frames into reflectance, and reflectance into cubes (thesis 2.5.1).
//!
//! A mosaic camera has one band filter per pixel, repeated every `P x P` pixels. [`Mosaic`] says where the filters lie,
//! [`Reference`] averages dark and white frames, [`Calibration`] turns raw frames into reflectance, per pixel or binned
//! by pattern cell into a band-sequential cube, [`Demosaicer`] brings every band to the mosaic's full resolution. Numbers in, numbers out: no files, no clock, no threads.

mod calibration;
mod demosaic;
mod error;
mod mosaic;
mod reference;

pub use calibration::{Calibration, FrameCounts, WhiteTarget};
pub use demosaic::{Demosaicer, Demosaicing};
pub use error::SpectralError;
pub use mosaic::{MAX_PATTERN, Mosaic};
pub use reference::Reference;
