//! Where submaps lie: odometry between neighbors, positions of an antenna, gravity and closed loops as one least-squares
//! problem over the submaps' poses (`docs/georeference.md`).
//!
//! Points never move against their submap. A pose here is `world_from_submap`; errors of poses are in the submap's own axes,
//! translation (m) before rotation vector (rad). Everything is a pure function of its inputs.
//!
//! - [`PoseGraph`] holds what was measured, [`PoseGraph::solve`] finds the poses and how well they are known.
//! - [`first_guess`] lays odometry onto positions: where is north, before anything else can be said.
//! - [`Keyframe`] is what a place looks like, [`LoopFinder`] finds it again and measures where it was seen from.

mod alignment;
mod elimination;
mod factors;
mod graph;
mod loops;
mod solve;
mod tangent;

pub use alignment::{Alignment, Sighting, first_guess};
pub use graph::{PoseGraph, Position, Relative, Upright};
pub use loops::{ClosedLoop, Keyframe, LoopFinder, LoopSettings};
pub use solve::{Gauge, Solution};
