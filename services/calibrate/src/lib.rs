//! Raw mosaics into reflectance cubes (thesis 2.5.1).
//!
//! Each mosaic camera of the drive has dark frames (lens closed) and white frames (a target of known reflectance) beside
//! its recording. From them every pixel has its own bias and gain; a raw frame becomes reflectance pixel by pixel, and the
//! pixels of a pattern cell become the bands of one cell of the cube, written straight into the slot that its consumers read.
//! [`spectral::Calibration`] has the formula and says which samples are masked.
//!
//! Where the drive names the camera maker's calibration file, the bands of the filters then become virtual bands with one
//! peak each ([`spectral::Correction`]), and if asked every value the median of its 3x3 cells. The cube's header has the
//! wavelengths of the bands that are in it. Order: crop, reflectance per pixel, binning or demosaicing, correction, median.
//!
//! A cube is as large as its camera and the setting `demosaic` say, never larger than a message (2^26 words):
//!
//! | camera | `bin` | full resolution |
//! |---|---|---|
//! | HS02, 2045 x 1085 px, 25 bands | 409 x 217 cells, 9.2 MB | 231 MB, and 49 MB in the stage |
//! | HS03, 2048 x 1024 px, 15 bands | 512 x 256 cells, 8.4 MB | 134 MB, and 46 MB in the stage |
//!
//! As many of them as consumers hold are in shared memory at once.
//!
//! The stage has no memory: a cube follows from its frame and the references alone. A camera without references gives no
//! cubes, and a frame that does not fit its camera gives none; both are counted and said, never fatal.

mod calibrate;
mod references;

pub use calibrate::Calibrate;

stage::settings! {
    /// Settings of calibrate.
    pub struct Settings {
        /// Apply the spectral correction of the cameras' calibration files. Cubes of cameras without one stay as measured.
        pub correction: bool = true => stage::any();
        /// Resolution of the cubes: `bin` has one cell for each cell of the pattern; `wb`, `id`, `iid` and `ppid` demosaic to one
        /// for each pixel (`spectral::demosaic`), which takes 16 or 25 times the memory and about 20 times the time.
        pub demosaic: String = "bin".to_owned() => stage::one_of(&["bin", "wb", "id", "iid", "ppid"]);
        /// Replace every value by the median of the valid ones in its 3x3 cells.
        pub median: bool = false => stage::any();
    }
}
