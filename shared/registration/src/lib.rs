//! Where the lidar was: deskew, surface features, a sliding local map, and scan-to-map odometry.
//!
//! The life of a sweep (after IMLS-SLAM, J.-E. Deschaud, ICRA 2018; thesis section 2.5.1):
//! 1. [`Sweep::new`] sorts the returns into a [`RangeImage`], ring by azimuth.
//! 2. Normals and planarity come from image neighbors; planar points, thinned in space, become features.
//! 3. The previous motion is repeated as a prediction; features are matched to the surface of the [`LocalMap`],
//!    with the motion *during* the sweep refined along with the pose.
//! 4. Directions that the scene does not determine are held to the prediction and reported.
//! 5. Small objects that stand where an earlier sweep saw through are moving: their points are reported.
//! 6. The other features enter the map; points of old sweeps leave it.
//!
//! Frames: `lidar` moves; `odom` is fixed, smooth and drifts. Metres and radians. Everything is a pure function of its
//! inputs, whatever the number of threads: work is cut into fixed chunks and reduced in their order.

#![allow(clippy::needless_bitwise_bool, reason = "loops without branches fill wide registers")]

mod cell;
mod eigen;
mod features;
mod ground;
mod incidence;
mod local_map;
mod maps;
mod matching;
mod motion;
mod moving;
mod navigation;
mod neighborhood;
mod normal_equations;
mod odometry;
mod range_image;
mod sampling;
mod seen;
mod sensors;
mod small_objects;
mod start;
mod sweep;
mod voxel;

pub use features::{Feature, FeatureSettings, planar_features};
pub use local_map::{Kernel, LocalMap, MapPoint, MapSettings, Surface, Weights};
pub use matching::{MatchSettings, Matched};
pub use motion::{DeskewTable, SweepMotion, Velocity};
pub use navigation::Lean;
pub use odometry::{Odometry, OdometrySettings, OdometryState, Registered, RegistrationError};
pub use range_image::RangeImage;
pub use sampling::Sampling;
pub use sensors::{GroundVelocity, InertialSample, SensorPlaces};
pub use sweep::{Sweep, TimedPoint, Turn, set_times_from_azimuth};
pub use voxel::thinned;
