//! Stamps, poses, geodetic positions, rigs, camera models, top-down grids and range images. Frames, axes and units follow
//! `docs/reference/conventions.md`.

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
