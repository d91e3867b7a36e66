//! Integration tests of the pose graph, of loop closures, and of the placement by fixes.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod drive;
mod graph;
mod loops;
mod placement;
