//! The stage on a synthetic street with ground truth, and on real sweeps.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

#[allow(dead_code, reason = "the example `sensor_faults` uses more of it")]
mod faulty_drive;
mod given;
#[path = "../../../../shared/georeference/tests/suite/gnss_row.rs"]
mod gnss_row;
mod imu_faults;
mod placement;
mod real_road;
mod secondary_lidars;
mod simulated_faults;
mod step;
mod street;
mod traffic;
#[path = "../../../../shared/registration/tests/suite/support/world.rs"]
#[allow(dead_code, reason = "the tests of the odometry use more of it")]
mod world;
