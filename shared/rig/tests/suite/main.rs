//! Rigs of simulated drives: right ones, and ones with a single fault.

mod cameras;
mod lidar;
mod other_lidars;
mod real_drives;
mod refining;
mod sources;
mod support;
