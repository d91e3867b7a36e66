//! Tests of simulated drives through the public interface.

mod drive;
mod geometry_of_sensors;
mod leaks;
mod lidar_models;
mod real_sweeps;
mod real_units;
mod rides;
mod support;
mod visibility;
