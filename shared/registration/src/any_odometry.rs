//! The odometry that a run uses.

use crate::{
    GivenMotion, GivenMotionState, GroundVelocity, ImlsOdometry, ImlsSettings, ImlsState, InertialSample, LocalMap,
    Odometry, OdometrySettings, OdometryState, Registered, RegistrationError, Revolution, SpinDirection, Sweep,
};
use geometry::{Pose, Stamp, Trajectory};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// An algorithm with its settings.
#[derive(Clone, Debug, PartialEq)]
pub enum Algorithm {
    /// [`Odometry`].
    ScanToMap,
    /// [`ImlsOdometry`].
    Imls(ImlsSettings),
    /// [`GivenMotion`] by these poses, `odom_from_body`.
    Given(Arc<Trajectory>),
}

/// A running odometry.
#[derive(Debug)]
pub enum SelectedOdometry {
    /// The default.
    ScanToMap(Box<Odometry>),
    /// IMLS-SLAM as published. It uses the LiDAR alone.
    Imls(Box<ImlsOdometry>),
    /// Given poses.
    Given(Box<GivenMotion>),
}

/// The saved state of a [`SelectedOdometry`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum SelectedState {
    /// State of [`Odometry`].
    ScanToMap(Box<OdometryState>),
    /// State of [`ImlsOdometry`].
    Imls(Box<ImlsState>),
    /// State of [`GivenMotion`].
    Given(Box<GivenMotionState>),
}

/// The saved state was written by a different algorithm.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "the saved state belongs to another odometry than the settings select: resume with the settings of the saved run"
)]
pub struct OtherAlgorithmError;

impl SelectedOdometry {
    /// Creates the odometry, see [`Odometry::new`].
    pub fn new(settings: OdometrySettings, algorithm: Algorithm, odom_from_lidar: Pose) -> Self {
        match algorithm {
            Algorithm::ScanToMap => Self::ScanToMap(Box::new(Odometry::new(settings, odom_from_lidar))),
            Algorithm::Imls(imls) => Self::Imls(Box::new(ImlsOdometry::new(settings, imls, odom_from_lidar))),
            Algorithm::Given(path) => Self::Given(Box::new(GivenMotion::new(path, settings.mounting.body_from_lidar))),
        }
    }
    /// Adds an inertial sample, see [`Odometry::add_imu`].
    pub fn add_imu(&mut self, sample: InertialSample) {
        if let Self::ScanToMap(odometry) = self {
            odometry.add_imu(sample);
        }
    }
    /// Sets whether the inertial samples are on probation, see [`Odometry::set_imu_probation`].
    pub fn set_imu_probation(&mut self, is_on_probation: bool) {
        if let Self::ScanToMap(odometry) = self {
            odometry.set_imu_probation(is_on_probation);
        }
    }
    /// Forgets the inertial samples, see [`Odometry::forget_imu`].
    pub fn forget_imu(&mut self) {
        if let Self::ScanToMap(odometry) = self {
            odometry.forget_imu();
        }
    }
    /// Adds a velocity, see [`Odometry::add_gnss`].
    pub fn add_gnss(&mut self, velocity: GroundVelocity) {
        if let Self::ScanToMap(odometry) = self {
            odometry.add_gnss(velocity);
        }
    }
    /// Registers the next sweep, see [`Odometry::register`].
    pub fn register(&mut self, sweep: &Sweep) -> Result<Vec<Registered>, RegistrationError> {
        match self {
            Self::ScanToMap(odometry) => odometry.register(sweep),
            Self::Imls(odometry) => odometry.register(sweep),
            Self::Given(given) => given.register(sweep).map(|registered| vec![registered]),
        }
    }
    /// Spin direction of a sensor without point times, see [`Odometry::turning`].
    pub fn turning(&self) -> Option<SpinDirection> {
        match self {
            Self::ScanToMap(odometry) => odometry.turning(),
            Self::Imls(_) | Self::Given(_) => None,
        }
    }
    /// The revolution of the next sweep, see [`Odometry::turning_at`].
    pub fn turning_at(&self, stamp: Stamp) -> Option<Revolution> {
        match self {
            Self::ScanToMap(odometry) => odometry.turning_at(stamp),
            Self::Imls(_) | Self::Given(_) => None,
        }
    }
    /// Message for the user about the result of [`SelectedOdometry::turning`].
    pub fn turning_note(&self) -> Option<String> {
        let turning = match self.turning()? {
            SpinDirection::Clockwise => "clockwise",
            SpinDirection::Counterclockwise => "counterclockwise",
        };
        Some(format!("the sweeps have no point times; surfaces that pass by show that the LiDAR turned {turning}"))
    }
    /// Returns the first sweep if no second sweep was registered.
    pub fn finish(&mut self) -> Option<Registered> {
        match self {
            Self::ScanToMap(odometry) => odometry.finish(),
            Self::Imls(odometry) => odometry.finish(),
            Self::Given(_) => None,
        }
    }
    /// The thinned map of smooth surfaces.
    pub fn map(&self) -> &LocalMap {
        match self {
            Self::ScanToMap(odometry) => odometry.map(),
            Self::Imls(odometry) => odometry.map(),
            Self::Given(given) => given.map(),
        }
    }
    /// The state on which the following sweeps depend.
    pub fn save(&self) -> SelectedState {
        match self {
            Self::ScanToMap(odometry) => SelectedState::ScanToMap(Box::new(odometry.save())),
            Self::Imls(odometry) => SelectedState::Imls(Box::new(odometry.save())),
            Self::Given(given) => SelectedState::Given(Box::new(given.save())),
        }
    }
    /// Continues from a state of [`SelectedOdometry::save`].
    pub fn load(
        settings: OdometrySettings,
        algorithm: Algorithm,
        state: SelectedState,
    ) -> Result<Self, OtherAlgorithmError> {
        match (algorithm, state) {
            (Algorithm::ScanToMap, SelectedState::ScanToMap(state)) => {
                Ok(Self::ScanToMap(Box::new(Odometry::load(settings, *state))))
            }
            (Algorithm::Imls(imls), SelectedState::Imls(state)) => {
                Ok(Self::Imls(Box::new(ImlsOdometry::load(settings, imls, *state))))
            }
            (Algorithm::Given(path), SelectedState::Given(state)) => {
                Ok(Self::Given(Box::new(GivenMotion::load(path, settings.mounting.body_from_lidar, *state))))
            }
            _ => Err(OtherAlgorithmError),
        }
    }
}
