//! The stage colorize, run without processes.

mod masks;
mod nuscenes;
mod simulated;
mod step;
mod support;
