//! What `replica train materials` and `replica evaluate materials` share: measured spectra of simulated drives with their true material.

mod library;
mod town_spectra;
pub mod train;

pub use town_spectra::{TownArgs, TownSpectra, is_held_out};
