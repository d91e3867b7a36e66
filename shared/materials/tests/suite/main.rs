//! The model of the project and models of known spectra.

mod built_in;
mod known_spectra;
