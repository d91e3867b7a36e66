//! The built-in model and models of known spectra.

mod built_in;
mod known_spectra;
