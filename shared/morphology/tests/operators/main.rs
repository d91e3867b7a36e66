//! All in one program: its operators are compiled once for each type of pixel.

mod against_definitions;
mod elements;
mod extrema_and_basins;
mod filled_gaps;
mod frozen;
mod limited_rise;
