//! What the program `replica` and its examples share.

pub mod town_sweeps;
