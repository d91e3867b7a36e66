//! LiDAR odometry: deskewing, planar features, a sliding local map, and scan-to-map registration.
//!
//! Steps for each sweep (after IMLS-SLAM, J.-E. Deschaud, ICRA 2018; thesis section 2.5.1):
//! 1. [`Sweep::new`] sorts the returns into a [`RangeImage`], ring by azimuth.
//! 2. Normals and planarity follow from image neighbors. Planar points, thinned in space, become features.
//! 3. Inertial samples and GNSS velocities predict the motion, or the previous motion continues. Features are matched to the
//!    surface of the [`LocalMap`]; the motion *during* the sweep is estimated along with the pose.
//! 4. Along degenerate directions the prediction is kept. Their number is reported.
//! 5. Small objects in space that was free in an earlier sweep are moving. Their points are reported.
//! 6. The other features are inserted into the map. Points of old sweeps are dropped.
//!
//! An [`OpenSubmap`] collects the deskewed points of the registered sweeps.
//!
//! [`ImlsOdometry`] is the published algorithm, for comparison; [`SelectedOdometry`] is the one that a run selects.
//!
//! Frames: `lidar` moves with the vehicle; `odom` is fixed, smooth and drifts. Metres and radians. Results do not depend on the
//! number of threads: work is split into fixed chunks whose results are reduced in order.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![allow(clippy::needless_bitwise_bool, reason = "branch-free loops vectorize")]

mod arc_tangent;
mod body_poses;
mod cell;
mod confirmed;
mod contested_stretches;
mod contrast;
mod degenerate_stretches;
mod eigen;
mod features;
mod ground;
mod ground_tilt;
mod imls;
mod incidence;
mod inertial_check;
mod kept_points;
mod kernel;
mod local_map;
mod lost_stretches;
mod maps;
mod matching;
mod motion;
mod moving;
mod navigation;
mod neighborhood;
mod normal_equations;
mod odometry;
mod other_lidar;
mod past_ranges;
mod point;
mod range_image;
mod raw_sweep;
mod ring_errors;
mod ring_order;
mod sampling;
mod selected;
mod sensors;
mod small_objects;
mod start;
mod stretches;
mod submap;
mod sweep;
mod sweep_features;
mod time_spans;
mod untimed_turn;
mod voxel;
mod words;

pub use body_poses::BodyPoses;
pub use features::{Feature, FeatureSettings, planar_features};
pub use imls::{ImlsOdometry, ImlsSettings, ImlsState};
pub use inertial_check::{Axes, Fit, InertialCheck, InertialCorrection, InertialMounting};
pub use kept_points::KeptPoints;
pub use kernel::{Kernel, Weights};
pub use local_map::{LocalMap, MapPoint, MapSettings, Surface};
pub use matching::{MatchSettings, Matched};
pub use motion::{DeskewTable, SweepMotion, Velocity};
pub use navigation::PredictionSources;
pub use odometry::{Odometry, OdometrySettings, OdometryState, Registered, RegistrationError};
pub use other_lidar::OtherLidar;
pub use point::TimedPoint;
pub use range_image::RangeImage;
pub use raw_sweep::{PreparedSweep, RawSweep, sweeps_by_tick};
pub use ring_errors::RingError;
pub use sampling::Sampling;
pub use selected::{Algorithm, OtherAlgorithmError, SelectedOdometry, SelectedState};
pub use sensors::{GroundVelocity, InertialSample, SensorMounting};
pub use stretches::Stretches;
pub use submap::{OpenSubmap, SubmapFrame, SweepRows};
pub use sweep::{SpinDirection, Sweep, set_times_from_azimuth};
pub use voxel::thinned;
pub use words::{MotionSensor, OdometryAlgorithm, UntimedTurn};
