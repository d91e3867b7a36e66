//! Prediction of the motion from an inertial unit and a GNSS receiver.

pub(crate) mod navigation;
pub(crate) mod sensors;
