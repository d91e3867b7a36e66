//! The shapes that a town is filled with. Nothing here knows where things stand.
//!
//! A thing is built at a pose: its origin on the ground, x along the street, y left, z up, m. What can move (vehicles,
//! people) is returned as primitives in its own frame, x forward, to be placed or driven. Lines of things follow a foot
//! line on the ground.

pub mod barrier;
pub mod bridge;
pub mod catalogue;
pub mod clutter;
pub mod facade;
pub mod fence;
mod frame;
pub mod furniture;
mod line;
pub mod person;
pub mod pole;
pub mod sign;
pub mod structure;
pub mod track;
pub mod tree;
pub mod two_wheeler;
pub mod vehicle;
pub mod water;
