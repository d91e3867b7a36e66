//! Neighborhoods and samples of point clouds: k nearest, radius, multiscale spheres; voxel grid, farthest point, random.
//!
//! [`SpatialIndex`] keeps the points in Morton order under a tree of bounding boxes. Networks on points and the smoothing of
//! materials search in it; [`VoxelGrid`] reduces a cloud to one point per cell.
//!
//! ```
//! let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
//! let index = neighbors::SpatialIndex::new(&points);
//! let nearest = index.nearest([0.9, 0.0, 0.0], 2);
//! assert_eq!(nearest.iter().map(|neighbor| neighbor.index).collect::<Vec<_>>(), [1, 0]);
//! ```
//!
//! A search is never approximate: results equal a search over all points with the same `f32` arithmetic, [`squared_distance`]. They never
//! depend on the number of threads. No input makes a search fail:
//!
//! | input | result |
//! |---|---|
//! | point with a coordinate that is NaN or beyond [`LIMIT_M`] | is never a neighbor; keeps its number |
//! | such a query, or a radius that is negative or NaN | no neighbors |
//! | k larger than the number of indexed points | all indexed points |
//! | radius 0 | points at exactly the query's position |
//! | equal distances | the smaller point number is first |
//! | UTM coordinates | [`around`] subtracts an origin in `f64`; within 1 km of it a coordinate moves by at most 0.031 mm |
//!
//! Where to start reading: `index.rs` builds the index, `tree.rs` and `candidates.rs` search it, `nearest.rs` and `within.rs` are the two
//! kinds of queries, and `batch.rs` runs many queries in parallel.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod batch;
mod blocks;
mod candidates;
mod farthest;
mod index;
mod morton;
mod nearest;
mod position;
mod random_sample;
mod spheres;
mod tree;
mod voxel_grid;
mod within;

pub use batch::Neighborhoods;
pub use index::{Neighbor, SpatialIndex};
pub use position::{LIMIT_M, around, squared_distance};
pub use random_sample::random_sample;
pub use spheres::{InvalidScales, MultiscaleSpheres, Scales};
pub use voxel_grid::{InvalidCell, VoxelGrid};
