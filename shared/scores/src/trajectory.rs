//! Scores of a trajectory: absolute errors, relative errors over a number of poses or a distance, KITTI's errors over segments.
//!
//! All scores are computed from [`PosePair`]s, which [`associate`] finds. Both trajectories must describe the same frame (the body
//! or the lidar); their world frames may differ.

mod align;
mod associate;
mod pose_pair;
mod relative;
mod segments;

pub use align::{AlignError, Alignment, Similarity, align};
pub use associate::{Association, associate, associate_by_number};
pub use pose_pair::{PosePair, distances_along, position_errors, rotation_errors};
pub use relative::{RelativeError, intervals_by_count, intervals_by_distance, relative_errors};
pub use segments::{KITTI_LENGTHS_M, KITTI_STEP, Segment, kitti_segments};
