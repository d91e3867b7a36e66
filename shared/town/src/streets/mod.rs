//! The street map: cross-sections, streets, the network that they form, and lanes through it.

pub mod country;
pub mod grid;
pub mod lane;
pub mod motorway;
pub mod network;
pub mod paving;
pub mod profile;
mod ring;
pub mod street;
