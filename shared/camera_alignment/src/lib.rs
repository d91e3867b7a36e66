//! Monitors the alignment of cameras and LiDAR during a run: angular offset of each camera, and delay of the exposures.
//!
//! 1. [`depth_edges()`] finds the outlines of objects in the points of a submap.
//! 2. [`AlignmentExposure::profiles`] reads the brightness of an image across the projected outlines.
//! 3. [`OffsetMonitor`] collects profiles over a run.
//! 4. [`fit()`] searches the rotation of each camera and the common delay that bring both together.
//! 5. [`report`] writes the result as log lines.
//!
//! Start reading at [`fit()`], the estimate, and at [`OffsetMonitor`], which decides which profiles are kept for it.
//!
//! Angles are radians in the axes of the camera (x right, y down, z forward), delays seconds; a positive delay means that exposures
//! are later than their stamps.
//!
//! This crate must never correct anything: it measures and reports, and does not change the rig or the colors of the
//! run. An offset that the scene does not constrain has no value. The crate decodes no images and uses no clock;
//! results depend only on the profiles and their order, so they survive a restart of the run.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod depth_edges;
mod fit;
mod monitor;
mod offset;
mod outlines;
mod profile;
pub mod report;
mod search;

pub use depth_edges::{DepthEdge, depth_edges};
pub use fit::{fit, fit_at_range, fit_rotation};
pub use monitor::{ExposureProfiles, OffsetMonitor, RANGES_M, RangeOffset, profiles_of_exposures};
pub use offset::{CameraOffset, Offset, Rotation};
pub use profile::{AlignmentExposure, MAX_AGE_S, Profile, REACH};
