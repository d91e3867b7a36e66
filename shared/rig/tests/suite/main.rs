//! Rigs of simulated drives: correct ones, and ones with a single fault.

mod boresight;
mod cameras;
mod lidar;
mod real_drives;
mod refining;
mod secondary_lidars;
mod sources;
mod support;
