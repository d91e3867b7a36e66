//! Moving objects: vehicles and people on their paths.

pub mod clearance;
pub mod fleet;
pub mod mover;
