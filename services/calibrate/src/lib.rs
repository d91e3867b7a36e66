//! Stage `calibrate`: turns raw mosaics into reflectance cubes (thesis 2.5.1).
//!
//! Each mosaic camera of the drive has dark frames (lens closed) and white references (a panel of known reflectance)
//! next to its recording. They determine bias and gain of every pixel. A raw frame becomes reflectance pixel by pixel,
//! and the pixels of a pattern cell become the bands of one cell of the cube, written directly into shared memory.
//! [`spectral::Calibration`] documents the formula and the masks.
//!
//! If the drive names the camera's calibration file, the bands of the filters become virtual bands with one peak each
//! ([`spectral::Correction`]). With the setting `median`, a 3x3 median filter follows. The cube's header has the wavelengths of its
//! bands. Order: crop, reflectance per pixel, binning or demosaicing, correction, median.
//!
//! The size of a cube follows from its camera and the setting `demosaic`; the largest message has 2^26 words:
//!
//! | camera | `bin` | full resolution |
//! |---|---|---|
//! | HS02, 2045 x 1085 px, 25 bands | 409 x 217 cells, 9.2 MB | 231 MB, and 49 MB in the stage |
//! | HS03, 2048 x 1024 px, 15 bands | 512 x 256 cells, 8.4 MB | 134 MB, and 46 MB in the stage |
//!
//! Shared memory contains as many cubes at once as consumers hold.
//!
//! With the setting `color_lines`, each cell of a cube gets the number of a region of similar spectra (crate
//! [`color_lines`]). A model divides some consecutive frames of one camera, or all frames if a model file is given; no
//! two models of a run share a region number.
//!
//! The saved state contains these models. Without `color_lines` it is empty: a cube depends on its frame and the
//! references only.
//!
//! Frames of a camera without references, and frames that do not fit their camera, are skipped, counted and reported. They do not end
//! the run.
//!
//! Start reading at `Calibrate::step` in `calibrate.rs`. The stage must never change a frame before its reflectance is computed, never
//! publish a value of a masked band as measured, and never use a reference of another camera.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod calibrate;
mod models;
mod references;

pub use calibrate::Calibrate;

use spectral::Resolution;

stage::words! {
    /// Regions of cubes by color lines.
    pub enum ColorLines {
        /// No regions.
        Off = "off",
        /// Every cell has the number of its region.
        Regions = "regions",
        /// Reflectances are replaced by the mean of the region.
        Simplified = "simplified",
    }
}

stage::settings! {
    /// Settings of calibrate.
    pub struct Settings {
        /// Mosaic cameras, by their names in drive.toml, whose frames become cubes. Empty: all. Several stages share the cameras: see
        /// `docs/guide/several_of_a_kind.md`.
        pub cameras: Vec<String> = Vec::new() => stage::any();
        /// Apply the spectral correction of the cameras' calibration files. Cubes of cameras without such a file are not corrected.
        pub correction: bool = true => stage::any();
        /// Resolution of the cubes: `bin` makes one cell per pattern cell; `wb`, `id`, `iid` and `ppid` demosaic to one
        /// cell per pixel (`spectral::demosaic`), with 16 or 25 times the memory and about 20 times the time.
        pub demosaic: Resolution = Resolution::Bin => stage::one_word();
        /// Replace every value by the median of the valid values in its 3x3 neighborhood.
        pub median: bool = false => stage::any();
        /// Regions of equal spectra by Graph-based Color Lines: `off`; `regions` gives every cell the number of its
        /// region; `simplified` also replaces its reflectances by the mean of the region. Cells without a valid value
        /// in all bands keep theirs and have no region.
        pub color_lines: ColorLines = ColorLines::Off => stage::one_word();
        /// Largest number of Gaussians, and therefore regions, of a model.
        pub color_lines_gaussians: u32 = 60 => stage::within(1, 4096);
        /// Frames of a camera that share a model, which is made from the first of them. 1: a model for each frame.
        pub color_lines_frames: u32 = 10 => stage::within(1, 1_000_000);
        /// Models of `replica-lab spectrum lines` (`model.json`) that divide all frames: one for each mosaic camera of
        /// the stage, in the order of drive.toml. Empty: models are made from the frames. A relative path is relative
        /// to the folder of launch.toml.
        pub color_lines_models: Vec<String> = Vec::new() => stage::any();
        /// Live: folder with the dark and white frames of the mosaic cameras, in the layout of a drive folder (`hs02/dark`, `hs02/white`);
        /// empty = the folder of the rig. A relative path is relative to the folder of launch.toml.
        pub references: String = String::new() => stage::any();
    }
}
