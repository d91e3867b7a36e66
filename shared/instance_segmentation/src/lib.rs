//! Objects of a labeled submap, such as vehicles and pedestrians, and their association over submaps (thesis section 6.5.2).
//!
//! [`TopView`] is the top-down grid of a submap with its digital terrain model. [`find()`] extracts the objects of one class. A
//! [`Tracker`] gives the objects of later submaps the ids of earlier ones. Start reading at [`find()`] in `find.rs`: it calls the
//! steps below in their order.
//!
//! The crate must never change a class, invent a point or depend on the order of points: it groups the points that the
//! stage `infer` has labeled. It does not depend on topics, clocks or files; the same submap gives the same objects in
//! the same order.
//!
//! | module | idea |
//! |---|---|
//! | `top_view` | grid, terrain and observed cells |
//! | `own_vehicle` | points of the vehicle that carries the LiDAR |
//! | `candidates` | points of a class below its height limit |
//! | `find` | all steps for one class |
//! | `object`, `footprint` | an object, its motion and the cells that it covers |
//! | `footprints` | cells of a class, dilated, filled and separated at peaks |
//! | `visits` | objects that pass the same cells at different times |
//! | `blobs`, `tracks`, `movers` | points of one sweep, tracked with constant velocity; pieces of the path of a moving
//! object are united |
//! | `rays` | free space, as proof of motion |
//! | `joining` | parts of a static object that is partly occluded |
//! | `density` | expected number of points of an object |
//! | `sets` | disjoint sets |
//! | `tracker` | the same object in several submaps |
//!
//! Frames: submap frame, z up; the tracker compares objects in odom. Lengths in m, times in ns since the Unix epoch.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod blobs;
mod candidates;
mod density;
mod find;
mod footprint;
mod footprints;
mod joining;
mod movers;
mod object;
mod own_vehicle;
mod rays;
mod sets;
mod settings;
mod top_view;
mod tracker;
mod tracks;
mod visits;

pub use density::Density;
pub use find::find;
pub use footprint::Footprint;
pub use object::{Motion, Object, Waypoint};
pub use own_vehicle::OwnVehicle;
pub use rays::Rays;
pub use settings::{FootprintSettings, Kind};
pub use top_view::{Cell, ThingPoint, TopView};
pub use tracker::{Known, TrackedObject, Tracker};
