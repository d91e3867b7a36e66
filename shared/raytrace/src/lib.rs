//! Ray tracing: primitives, a bounding volume hierarchy over them, and packets of rays.
//!
//! | module | content |
//! |---|---|
//! | `ray` | rays |
//! | `shape`, `intersect`, `flat` | primitives and their intersection with a ray |
//! | `binary_tree`, `wide_tree`, `bvh` | the bounding volume hierarchy |
//! | `objects` | a second hierarchy over moving objects, each with a hierarchy of its own |
//! | `packet`, `packet_queries` | sixteen rays at a time |
//!
//! Start reading at [`Bvh`] for static geometry and at [`ObjectTree`] for moving objects; [`Primitive`] and [`Shape`]
//! document the primitives. [`Bvh::nearest_of`] casts packets, which is several times as fast as single rays.
//!
//! All geometry is f32, in metres. Within 1 km of the origin a step of f32 is below 0.1 mm.
//!
//! The crate must never give a different answer for a packet of rays than for the same rays one by one, and never an
//! answer that depends on the order in which primitives were added, except between surfaces at the same distance. It
//! does not depend on towns, sensors or materials: a hit is the number of a primitive and a distance.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod binary_tree;
mod bvh;
mod flat;
mod intersect;
mod objects;
mod packet;
mod packet_queries;
mod ray;
mod shape;
mod wide_tree;

pub use bvh::Bvh;
pub use objects::{ObjectTree, PlacedObject};
pub use packet::PACKET_SIZE;
pub use ray::{Ray, Vec3};
pub use shape::{Primitive, Shape};
