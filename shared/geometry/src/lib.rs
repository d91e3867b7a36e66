//! Stamps, poses, places on the Earth, rigs, camera models and top-down grids, range images. Frames, axes and units: `docs/conventions.md`.

mod bev;
mod camera;
mod geodesy;
mod pose;
mod range_image;
mod rectangle;
mod rig;
mod spline_warp;
mod stamp;
mod utm;

pub use bev::BevGrid;
pub use camera::{CameraModel, KannalaBrandt, Pinhole};
pub use geodesy::{Geodetic, LocalFrame};
pub use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector2, Vector3};
pub use pose::{Pose, Trajectory, interpolate};
pub use range_image::{NO_POINT, RangeImage, SphericalGrid, column_angle, column_of_azimuth};
pub use rectangle::OrientedRectangle;
pub use rig::{Rig, RigCamera};
pub use spline_warp::{SplineSurface, SplineWarp};
pub use stamp::Stamp;
pub use utm::{Utm, UtmError};
