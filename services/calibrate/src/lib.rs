//! Raw mosaics into reflectance cubes (thesis 2.5.1).
//!
//! Each mosaic camera of the drive has dark frames (lens closed) and white frames (a target of known reflectance) beside
//! its recording. From them every pixel has its own bias and gain; a raw frame becomes reflectance pixel by pixel, and the
//! pixels of a pattern cell become the bands of one cell of the cube, written straight into the slot that its consumers read.
//! [`spectral::Calibration`] has the formula and says which samples are masked.
//!
//! The stage has no memory: a cube follows from its frame and the references alone. A camera without references gives no
//! cubes, and a frame that does not fit its camera gives none; both are counted and said, never fatal.

mod calibrate;
mod references;

pub use calibrate::Calibrate;

stage::settings! {
    /// Settings of calibrate.
    pub struct Settings {}
}
