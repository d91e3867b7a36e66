//! Poses of the submaps of a drive in the world: one least-squares problem over the submaps' poses
//! (`docs/explanation/georeferencing.md`).
//!
//! | measurement | module |
//! |---|---|
//! | odometry between consecutive submaps, with its covariance | `drift` |
//! | antenna positions from the fixes of a GNSS receiver, and their errors | `fixes`, `receiver_errors`, `lasting_error`, `receiver_filter` |
//! | direction of gravity from the samples of an inertial unit | `gravity` |
//! | loop closures: places that were visited twice | [`loops`](LoopFinder) |
//!
//! - [`Georeferencer`] collects the measurements during the drive and solves the problem at the end.
//! - [`PoseGraph`] holds the measurements. [`PoseGraph::solve`] finds the poses and their covariances.
//! - [`GivenPlacing`] takes the poses of the submaps from a post-processed trajectory instead.
//! - [`align_odometry`] finds north and the offset to the world before the graph is solved.
//! - [`Keyframe`] describes the surroundings of a submap, [`LoopFinder`] recognizes them later, [`Places`] keeps one
//!   keyframe of each place.
//!
//! Start reading at [`Georeferencer::solve`]: it takes the poses of the odometry, `odom_from_submap`, and returns the
//! poses after all measurements, `world_from_submap`. Only this crate transforms from odom to the world.
//!
//! Errors of poses are in the axes of the submap, translation (m) before rotation vector (rad).
//!
//! This crate must never move points relative to their submap, and never change the path within a submap: it moves
//! submaps as rigid bodies. It must never hide a contradiction: fixes that disagree with the majority are rejected,
//! counted and reported by [`fix_doubts()`]. Everything is a pure function of its inputs, without clocks and files.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod alignment;
mod antenna_track;
mod deviations;
mod drift;
mod fix_doubts;
mod fix_shape;
mod fixes;
mod georeferencer;
mod given_placing;
mod graph;
mod gravity;
mod inertial_unit;
mod lasting_error;
mod loops;
mod median;
mod path_difference;
mod path_prior;
mod placing;
mod receiver_clock;
mod receiver_errors;
mod receiver_filter;
mod recent_path;
mod words;

pub use alignment::{Alignment, PointPair, align_odometry};
pub use fix_doubts::fix_doubts;
pub use georeferencer::{FixUse, GeoreferenceSettings, Georeferencer, Placed};
pub use given_placing::GivenPlacing;
pub use graph::{AntennaPosition, Gauge, HorizontalVelocity, PoseGraph, RelativePose, Solution, Start, UpDirection};
pub use inertial_unit::InertialUnit;
pub use loops::{
    Fit, FitFloor, Keyframe, LoopClosure, LoopFinder, LoopSettings, Places, SurfacePoint, refine, surface_map,
};
pub use path_difference::path_difference;
pub use path_prior::PathSteps;
pub use receiver_clock::ReceiverDelay;
pub use words::{Correction, PathSource};
