//! Construction of a town: placement and order of all objects.

pub mod block_use;
pub mod build;
mod crossings;
mod gardens;
pub mod ground;
mod junction;
mod kerbside;
mod motorway;
mod open_blocks;
mod parking;
mod queue;
pub mod reach;
mod roadside;
mod rows;
mod rural;
pub mod tour;
pub mod town_builder;
mod traffic;
