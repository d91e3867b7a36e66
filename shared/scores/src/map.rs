//! How good a map is: how crisp it is by itself, and how far it is from the truth.
//!
//! A trajectory may drift by a meter over a kilometer and its map be crisp everywhere, and the other way round: these measures say
//! what a trajectory's errors do not. All of them depend on how dense a cloud is, so only clouds of the same returns may be
//! compared.

mod crispness;
mod distance;
mod index;
mod patch;

pub use crispness::{Crispness, CrispnessSettings, crispness};
pub use distance::{DistanceSettings, Distances, WITHIN_M, distances};
pub use index::PointIndex;
pub use patch::Patch;
