//! Colors and spectra of a submap's points, from the exposures of its cameras (thesis 2.5.1, 4.3.2).
//!
//! [`color_into`] and [`SpectraColumn`] give each point its color and its spectrum:
//!
//! 1. [`SubmapPoints`] splits a submap into chunks, [`ProjectionCamera`] prepares lenses and exposures.
//! 2. [`visibility_maps`] computes for every exposure how far it sees in each direction (occlusion by other points).
//! 3. [`Choices`] selects one exposure for each point: the visible one with the smallest expected color position error.
//! 4. [`ColorImage`] and [`CubeImage`] are sampled at the projected pixel. [`Sampler`] levels the brightness of exposures and
//!    avoids pixels that show the sky.
//!
//! [`ExposureWindow`] holds the exposures that submaps may still need, [`DoubtLimits`] judges the final result.
//!
//! Start at [`color_into`]: images of one submap in, one row per point out. The stage `colorize` shows the order of the
//! calls.
//!
//! Frames: poses of exposures and submaps are in odom (`odom_from_body`, `odom_from_submap`), because colors are computed before
//! the placement. Pixels are px, with integers at pixel centers; colors are sRGB, 8 bit; reflectance is 1 for a perfect white
//! diffuser.
//!
//! This crate must never invent a value: a point that no exposure sees stays unseen, no value is interpolated between points, and
//! black is a color. It decodes no images and reads no files or clocks. Results do not depend on the number of threads.
//!
//! # Vectorized loops
//! As in `wide_loops::run`, but the work is a struct with its own `call`. The arrays of a loop belong to one or two
//! structs and have constant length: only then can the compiler prove that they do not overlap.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![allow(clippy::needless_bitwise_bool, reason = "conditions without jumps let the loops over a chunk become vectors")]

mod bands;
mod camera;
mod candidates;
mod choice;
mod chunk;
mod color;
mod color_doubts;
mod color_image;
mod cube_image;
mod exposure;
mod exposure_window;
mod frustum;
mod gains;
mod lens;
mod occlusion;
mod points;
mod projection;
mod sky;
mod spectra;
mod visibility;

pub use bands::{Bands, KnownBands, TooManyBands};
pub use camera::ProjectionCamera;
pub use candidates::{AgeLimits, Candidates};
pub use choice::{Choices, PointChoice, ShownPoint};
pub use chunk::{CHUNK, Chunk, Lanes, seconds};
pub use color::{ColorSteps, PointColor, Sampler, color_into};
pub use color_doubts::{DoubtLimits, ExposureKind};
pub use color_image::ColorImage;
pub use cube_image::CubeImage;
pub use exposure::PosedExposure;
pub use exposure_window::{ExposureTally, ExposureWindow, ExposuresInRange, HeldExposure, HeldWithPose};
pub use frustum::Frustum;
pub use gains::{ExposureGains, Overlap, overlaps};
pub use lens::Lens;
pub use occlusion::visibility_maps;
pub use points::{PointBuffers, SubmapPoints};
pub use spectra::{CameraCubes, SpectraColumn};
pub use visibility::{CellGrid, VisibilityMap};
