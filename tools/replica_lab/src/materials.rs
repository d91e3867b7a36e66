//! Shared by `replica-lab fit-materials` and `evaluate materials`: measured spectra of simulated drives with their true material.

pub mod fit;
mod library;
mod town_spectra;

pub use town_spectra::{TownArgs, TownSpectra, is_held_out};
