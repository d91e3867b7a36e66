//! Materials of points and pixels from their spectra (docs/explanation/spectra.md).
//!
//! 1. [`Spectra`] are the measured bands of points or pixels; [`ndvi`] is their vegetation index.
//! 2. A [`Model`] has reference spectra and the covariance of measurements around them: noise, texture, sun and shadow.
//!    [`Fit`] fits it to labeled spectra.
//! 3. A [`Classifier`] compares a spectrum with the references by one [`Method`], in the measured bands.
//! 4. [`materials_of`] classifies all points of a submap, smoothed over their neighbors and regions of cubes
//!    ([`Smoothing`]); [`PointMaterials`] computes the column of a submap.
//!
//! Start reading at [`materials_of`] in `column.rs`, then at [`Classifier`]. All reflectances are shares of the incoming light, 0 to 1;
//! wavelengths are in nm. The distances to the references work on natural logarithms of reflectances.
//!
//! The crate must never guess: a spectrum that is far from all references, or that was measured in too few bands, has the
//! material `unknown`. It never uses masked bands, and it does not depend on files, cameras or topics: the built-in model
//! is part of the program, and `replica-lab fit-materials` fits others.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod band_place;
mod classifier;
mod column;
mod fit;
mod gaussian;
mod model;
mod smoothing;
mod spectra;

pub use classifier::{Classifier, Method, N_MATERIALS, Probabilities};
pub use column::{Places, PointMaterials, best_row, materials_of};
pub use fit::Fit;
pub use model::{Light, Model, ModelError, Reference};
pub use smoothing::{Smoothing, mean_spectra, region_means, votes};
pub use spectra::{Spectra, Spectrum, ndvi};
