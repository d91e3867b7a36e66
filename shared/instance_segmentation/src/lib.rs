//! Objects of a labelled submap, such as vehicles and pedestrians, and their association over submaps (thesis section 6.5.2).
//!
//! [`TopView`] is the top-down grid of a submap with its digital terrain model. [`find`] extracts the objects of one class. A
//! [`Tracker`] gives the objects of later submaps the ids of earlier ones.
//!
//! | module | idea |
//! |---|---|
//! | `top_view` | grid, terrain and observed cells |
//! | `candidates` | points of a class below its height limit |
//! | `footprints` | cells of a class, dilated, filled and separated at peaks |
//! | `visits` | objects that pass the same cells at different times |
//! | `blobs`, `tracks`, `movers` | points of one sweep, followed with constant velocity; pieces of the path of a moving object are united |
//! | `joining` | parts of a standing object that others hide in part |
//! | `objects` | objects from footprints, visits, movers and joining |
//! | `density` | expected number of points of an object |
//! | `sets` | disjoint sets |
//! | `tracker` | the same object in several submaps |
//!
//! Frames: submap frame, z up; the tracker compares objects in odom. Lengths in m, times in ns since the Unix epoch.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod blobs;
mod candidates;
mod density;
mod footprints;
mod joining;
mod movers;
mod objects;
mod sets;
mod settings;
mod top_view;
mod tracker;
mod tracks;
mod visits;

pub use density::Density;
pub use movers::Motion;
pub use objects::{Object, find};
pub use settings::{FootprintSettings, Kind};
pub use top_view::{Cell, TopView};
pub use tracker::{TrackedObject, Tracker};
