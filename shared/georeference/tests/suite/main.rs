//! Integration tests of the pose graph, of loop closures, and of the placement by fixes.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod drive;
mod gnss_row;
mod graph;
mod kitti_drive;
mod loops;
mod matched;
mod placement;
mod real_receiver;
mod refined;
mod scored;
