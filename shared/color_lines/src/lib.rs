//! Graph-based Color Lines: an image of any number of bands as a few Gaussians and lines through the spectral space (thesis, chapter 3;
//! Duque-Arias et al., ICIAP 2019).
//!
//! 1. [`Space`]: pixels become points in three dimensions, the bands of a color image or principal components. With a spatial weight the
//!    pixel coordinates are also channels.
//! 2. The space is divided into [`Hemispheres`]; the maxima of the histogram of each one are the start of its Gaussian mixture.
//! 3. The pixels of a Gaussian are a [`Region`] with a mean spectrum. A minimum spanning [`Tree`] joins the spectra and the origin; its
//!    longest paths are color [`Line`]s.
//! 4. The simplified image has the spectrum of the region ([`Model::simplified`]) or the nearest point on the lines
//!    ([`Model::projected`]) in each pixel.
//!
//! [`CubeRegions`] divides the cubes of a drive.
//!
//! Baselines: [`project_onto_straight_lines`] (Dynamic Color Lines), [`slic()`] (superpixels).
//!
//! Start reading at [`Model::fit`] in `model.rs`: it calls the steps in their order. [`Settings`] documents the parameters.
//!
//! The crate must never depend on the number of threads or on the time: the same image gives the same regions, bit by bit. It never
//! reads files, and it never fills invalid pixels: a pixel with a value that is not finite has region 0 and changes no other pixel.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod blocks;
mod cube_regions;
mod error;
mod exponential;
mod gaussian;
mod hemispheres;
mod histogram;
mod image;
mod k_means;
pub mod mixture;
mod model;
mod projection;
mod settings;
mod slic;
mod slices;
mod space;
mod straight_lines;
mod tree;

pub use cube_regions::{CubeRegions, CubeSettings};
pub use error::ColorLinesError;
pub use gaussian::{Gaussian, REGULARIZATION};
pub use hemispheres::Hemispheres;
pub use image::{Image, band_sequential};
pub use model::{Fit, Model, Region};
pub use projection::Projection;
pub use settings::{MAX_GAUSSIANS, Settings, Start};
pub use slic::slic;
pub use slices::Slice;
pub use space::{Points, Space};
pub use straight_lines::{StraightLines, project_onto_straight_lines};
pub use tree::{Line, Tree};
