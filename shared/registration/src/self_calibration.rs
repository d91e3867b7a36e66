//! Errors of the sensors that are estimated during the drive: elevations of the rings, direction of rotation, axes of the
//! inertial unit.

pub(crate) mod ground_tilt;
pub(crate) mod inertial_check;
pub(crate) mod ring_errors;
pub(crate) mod spin_direction;
