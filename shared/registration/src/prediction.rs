//! Prediction of the motion by an inertial unit and a GNSS receiver.

pub(crate) mod navigation;
pub(crate) mod sensors;
