//! Geometry of each kind of object. No module here places objects in the town.
//!
//! An object is built at a pose: origin on the ground, x along the street, y left, z up, m. Vehicles and people are returned as
//! primitives in their own frame, x forward, to be placed or moved. Fences, walls and rails follow a foot line on the ground.

mod balcony;
pub mod barrier;
pub mod bridge;
pub mod catalogue;
pub mod clutter;
pub mod facade;
pub mod fence;
mod frame;
pub mod furniture;
pub mod house;
mod line;
mod opening;
pub mod person;
pub mod pole;
mod roof;
pub mod sign;
pub mod structure;
pub mod style;
pub mod track;
pub mod tree;
pub mod two_wheeler;
pub mod vehicle;
mod wall;
pub mod water;
