//! LiDAR odometry: deskewing, planar features, a sliding local map, and scan-to-map registration.
//!
//! Start reading at `Odometry::follow` in `odometry.rs`: the processing of a sweep, step by step. `matching.rs` has the
//! equations.
//!
//! | folder | content |
//! |---|---|
//! | `sweep` | returns as a range image, rings, shape of the surface around each return |
//! | `features` | planar and rough points with normals, and the samples that are matched |
//! | `map` | sliding map of points with normals, and its implicit surface |
//! | `prediction` | error-state Kalman filter of inertial unit and GNSS velocities |
//! | `matching` | scan-to-map matching |
//! | `observability` | which directions the scene constrains, and stretches of the drive with degenerate geometry |
//! | `self_calibration` | errors of rings, direction of rotation, axes of the inertial unit |
//! | `moving_objects` | small objects in space that an earlier sweep observed as free |
//! | `odometry` | the odometry of a run, and its initialization from two sweeps |
//! | `submap` | deskewed points of registered sweeps as rows of topic `submap` |
//! | `imls` | IMLS-SLAM as published |
//!
//! Steps for each sweep (after IMLS-SLAM, J.-E. Deschaud, ICRA 2018; thesis section 2.5.1):
//! 1. [`Sweep::new`] sorts the returns into a [`RangeImage`], ring by azimuth.
//! 2. Normals and planarity are computed from image neighbors. Planar points, thinned in space, become features.
//! 3. Inertial samples and GNSS velocities predict the motion, or the previous motion continues. Features are matched to the
//!    surface of the [`LocalMap`]; the motion *during* the sweep is estimated along with the pose.
//! 4. Along degenerate directions the prediction is kept. Their number is reported.
//! 5. Small objects in space that was free in an earlier sweep are moving. Their points are reported.
//! 6. The other features are inserted into the map. Points of old sweeps are dropped.
//!
//! An [`OpenSubmap`] collects the deskewed points of the registered sweeps.
//!
//! [`GivenMotion`] takes the poses from a post-processed trajectory instead.
//! [`ImlsOdometry`] is the published algorithm, for comparison; [`SelectedOdometry`] is the algorithm selected for a
//! run.
//!
//! Frames: `lidar` moves with the vehicle; `odom` is fixed, smooth and drifts. Metres and radians. The odometry does
//! not use world coordinates: it returns `odom_from_lidar`, and `georeference` transforms the result to the world.
//!
//! This crate must never use clocks, files or unseeded randomness, and never correct a pose that it has returned. Results do not
//! depend on the number of threads: work is split into fixed chunks whose results are reduced in order.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![allow(clippy::needless_bitwise_bool, reason = "branch-free loops vectorize")]

mod any_odometry;
mod features;
mod given_motion;
mod imls;
mod map;
mod matching;
mod motion;
mod moving_objects;
mod observability;
mod odometry;
mod prediction;
mod registered;
mod secondary_lidar;
mod self_calibration;
mod submap;
mod sweep;
mod voxel;
mod words;

pub use any_odometry::{Algorithm, OtherAlgorithmError, SelectedOdometry, SelectedState};
pub use features::sampling::Sampling;
pub use features::{Feature, FeatureSettings, planar_features};
pub use given_motion::{GivenMotion, GivenMotionState};
pub use imls::{ImlsOdometry, ImlsSettings, ImlsState};
pub use map::kernel::{Kernel, Weights};
pub use map::local_map::{LocalMap, MapPoint, MapSettings, Surface};
pub use matching::{Acceleration, MatchScale, MatchSettings, Matched};
pub use motion::{DeskewTable, SweepMotion, Velocity};
pub use observability::Stretches;
pub use odometry::{Odometry, OdometrySettings, OdometryState};
pub use prediction::navigation::PredictionSources;
pub use prediction::sensors::{GroundVelocity, InertialSample, SensorMounting};
pub use registered::{Registered, RegistrationError};
pub use secondary_lidar::SecondaryLidar;
pub use self_calibration::inertial_check::{Axes, Fit, InertialCheck, InertialCorrection, InertialMounting};
pub use self_calibration::ring_errors::RingError;
pub use submap::body_poses::BodyPoses;
pub use submap::kept_points::KeptPoints;
pub use submap::raw_sweep::{PreparedSweep, RawSweep, SweepsByTick, sweeps_by_tick};
pub use submap::{OpenSubmap, SubmapFrame, SweepRows};
pub use sweep::point::TimedPoint;
pub use sweep::range_image::RangeImage;
pub use sweep::{Revolution, SpinDirection, Sweep, set_times_from_azimuth};
pub use voxel::thinned;
pub use words::{MotionSensor, OdometryAlgorithm, UntimedTurn};
