//! The stage on a synthetic street with ground truth, and on real sweeps.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

#[path = "../../../../shared/georeference/tests/suite/gnss_row.rs"]
mod gnss_row;
mod imu_faults;
mod placement;
mod secondary_lidars;
mod step;
mod street;
mod traffic;
#[path = "../../../../shared/registration/tests/suite/support/world.rs"]
#[allow(dead_code, reason = "the tests of the odometry use more of it")]
mod world;
