//! Sensor models. Each sensor observes the scene by ray casts or the motion by its pose, adds its own noise, and does not
//! depend on the other sensors.

pub mod camera;
pub mod exposure;
pub mod filter;
pub mod gnss;
pub mod imu;
mod lens;
pub mod lidar;
pub mod look;
pub mod mosaic;
mod sky_view;
pub mod trigger;
