//! Geometry shared by all crates: stamps, poses, geodetic positions, rigs, camera models, top-down grids and range images.
//!
//! Frames, axes and units follow `docs/reference/conventions.md`: metres, radians, f64 for poses. A pose is named by its
//! direction: `odom_from_body * p_in_body` is the point in odom.
//!
//! | task | start at |
//! |---|---|
//! | transform and interpolate poses over time | [`Pose`], [`Trajectory`] |
//! | convert between WGS84, a local east-north-up frame, UTM | [`LocalFrame`], [`Utm`], [`Projection`] |
//! | look up the mounting of a sensor | [`Rig`] |
//! | project a point into an image and back | [`CameraModel`] |
//! | sort points into a grid | [`BevGrid`] from above, [`RangeImage`] as seen from the LiDAR |
//!
//! This crate must never read files, clocks or the environment, and does not depend on messages or settings: it is the
//! lowest crate that the algorithms share. Functions are pure, so equal inputs give equal bits. An impossible result (a
//! point behind the camera, a stamp outside a trajectory) is `None` or an error, never a default such as the identity
//! pose.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod bev;
mod bev_image;
mod camera;
mod geodesy;
mod pose;
mod projection;
mod range_image;
mod rectangle;
mod rig;
mod spline_warp;
mod stamp;
mod utm;

pub use bev::BevGrid;
pub use bev_image::{BevStatistic, BevValues};
pub use camera::{CameraModel, KannalaBrandt, Pinhole};
pub use geodesy::{Geodetic, LocalFrame};
pub use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector2, Vector3};
pub use pose::{Pose, Trajectory, heading, interpolate};
pub use projection::{Projection, ProjectionError};
pub use range_image::{NO_POINT, RangeImage, SphericalGrid, column_angle, column_of_azimuth};
pub use rectangle::OrientedRectangle;
pub use rig::{Rig, RigCamera};
pub use spline_warp::{SplineSurface, SplineSurfaceError, SplineWarp};
pub use stamp::Stamp;
pub use utm::{Utm, UtmError};
