//! The pose graph and the loop search on drives whose truth is known.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod graph;
mod loops;
