//! All tests of the crate's public interface in one program.

mod against_definitions;
mod elements;
mod extrema_and_basins;
mod filled_gaps;
mod limited_rise;
mod scikit_image;
