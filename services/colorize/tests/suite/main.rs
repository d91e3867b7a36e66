//! The stage colorize, run without processes.

mod doubts;
mod masks;
mod nuscenes;
mod simulated;
mod step;
mod support;
