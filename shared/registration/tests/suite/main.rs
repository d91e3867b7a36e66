//! The odometry on synthetic and real sweeps.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod imls;
mod large_motion;
mod other_sensors;
mod real_sweeps;
mod support;
mod synthetic_drive;
mod traffic;
