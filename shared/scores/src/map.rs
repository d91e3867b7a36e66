//! Scores of a point cloud: its sharpness, which needs no truth, and its distance to a true cloud.
//!
//! These scores complement trajectory errors: a trajectory may drift by a metre per kilometre while its cloud is sharp
//! everywhere, and vice versa. All scores depend on the density of the cloud, so compare only clouds of the same
//! returns.

mod crispness;
mod distance;
mod index;
mod patch;

pub use crispness::{Crispness, CrispnessSettings, crispness};
pub use distance::{DistanceSettings, Distances, WITHIN_M, distances};
pub use index::PointIndex;
pub use patch::Patch;
