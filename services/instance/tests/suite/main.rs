//! All tests of the stage in one program.

mod extensions;
mod lidar_streets;
mod real_sweep;
mod step;
mod support;
