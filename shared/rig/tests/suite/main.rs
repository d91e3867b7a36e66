//! Rigs of simulated drives: right ones, and ones with a single fault.

mod cameras;
mod lidar;
mod real_drives;
mod refining;
mod secondary_lidars;
mod sources;
mod support;
