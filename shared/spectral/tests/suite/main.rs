//! Calibration and demosaicing on synthetic scenes and real frames.

mod demosaic;
mod real_mosaic;
mod reflectance;
