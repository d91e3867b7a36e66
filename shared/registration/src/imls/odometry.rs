//! The steps of the paper, applied to each sweep.

use super::ImlsSettings;
use super::matching::{Reported, match_samples};
use super::model::{Model, SavedModel};
use super::sweep_points::SweepPoints;
use crate::features::sampling::sampled;
use crate::features::sweep_features::SweepFeatures;
use crate::map::maps::{Maps, SavedMaps};
use crate::motion::Velocity;
use crate::moving_objects::{MovingDetector, MovingPoints};
use crate::odometry::initialization::{InitialMotion, initialize};
use crate::prediction::navigation::{Navigation, PredictionSources, StepMeasurement};
use crate::prediction::sensors::SensorLog;
use crate::self_calibration::spin_direction::TurnLever;
use crate::{
    Feature, LocalMap, Matched, OdometrySettings, Registered, RegistrationError, Sampling, Sweep, SweepMotion,
};
use geometry::{Pose, Stamp, Vector3, interpolate};
use nalgebra::{Matrix6, Point3};
use serde::{Deserialize, Serialize};

/// Consecutive sweeps without a match (half a second) after which a new model begins: the old one is out of reach. Not
/// in the paper.
const MAX_BRIDGED: u32 = 5;
/// Motion or rotation after which the map for loop closures grows, as in [`crate::Odometry`].
const MIN_MOTION_M: f64 = 0.1;
const MIN_ROTATION_RAD: f64 = 0.01;
/// Lower bound for the time between the last shots of two sweeps, s, in case the stamps of a recording contradict the
/// point times.
const MIN_SECONDS: f64 = 1e-3;

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Last {
    end_stamp: Stamp,
    end: Pose,
    /// Velocity between the last shots of the last two sweeps.
    velocity: Velocity,
    mid_stamp: Stamp,
    mid: Pose,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct First {
    features: SweepFeatures,
    points: SweepPoints,
}

/// The saved state, see [`ImlsOdometry::save`]: 12 bytes for each point of the model, 72 MB with 100 sweeps of 60 000
/// points, and the parts shared with [`crate::OdometryState`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ImlsState {
    begin: Pose,
    /// The first sweep, until the second one is registered.
    first: Option<First>,
    last: Option<Last>,
    n_inserted: u32,
    /// Pose of the last extension of the map for loop closures.
    grown_at: Option<Pose>,
    n_grown: u32,
    bridged_in_a_row: u32,
    navigation: Option<Navigation>,
    /// Always empty: the algorithm uses the LiDAR alone.
    log: SensorLog,
    moving: MovingDetector,
    maps: SavedMaps,
    model: SavedModel,
}

/// IMLS-SLAM; see the module. The same sweeps give the same bits on any number of threads and after any save and load.
#[derive(Debug)]
pub struct ImlsOdometry {
    /// Ranges, mounting, and settings of the parts that are not in the paper.
    settings: OdometrySettings,
    imls: ImlsSettings,
    /// The saved part of the state. Its `maps` and `model` are empty while running: see the fields below.
    state: ImlsState,
    maps: Maps,
    model: Model,
}

impl ImlsOdometry {
    /// Creates the odometry, see [`crate::Odometry::new`].
    pub fn new(settings: OdometrySettings, imls: ImlsSettings, odom_from_lidar: Pose) -> Self {
        let state = ImlsState {
            begin: odom_from_lidar,
            first: None,
            last: None,
            n_inserted: 0,
            grown_at: None,
            n_grown: 0,
            bridged_in_a_row: 0,
            navigation: None,
            log: SensorLog::default(),
            moving: MovingDetector::default(),
            maps: SavedMaps::default(),
            model: SavedModel::default(),
        };
        Self { settings, imls, state, maps: Maps::default(), model: Model::default() }
    }

    /// Registers the next sweep, see [`crate::Odometry::register`].
    pub fn register(&mut self, sweep: &Sweep) -> Result<Vec<Registered>, RegistrationError> {
        let features = self.features(sweep);
        let before = self.state.last.as_ref().map(|last| last.mid_stamp);
        if let Some(last) = before.or(self.state.first.as_ref().map(|first| first.features.mid_stamp))
            && features.mid_stamp <= last
        {
            return Err(RegistrationError::Order { last, got: features.mid_stamp });
        }
        if let Some(last) = self.state.last.take() {
            return Ok(vec![self.follow(&features, sweep, &last)]);
        }
        let Some(first) = self.state.first.take() else {
            self.wait(features, sweep);
            return Ok(Vec::new());
        };
        Ok(self.start(&first, features, sweep))
    }

    /// Returns the first sweep if no second one was registered, see [`crate::Odometry::finish`].
    pub fn finish(&mut self) -> Option<Registered> {
        let first = self.state.first.take()?;
        Some(registered(&first.features, SweepMotion::still(self.state.begin), None))
    }

    /// The thinned map of smooth surfaces for loop closures. Sweeps are not matched to it.
    pub fn map(&self) -> &LocalMap {
        &self.maps.smooth
    }

    /// Points of the model.
    pub fn model_len(&self) -> usize {
        self.model.len()
    }

    /// The state on which the following sweeps depend.
    pub fn save(&self) -> ImlsState {
        ImlsState { maps: self.maps.save(), model: self.model.save(), ..self.state.clone() }
    }

    /// Continues from a state of [`ImlsOdometry::save`].
    pub fn load(settings: OdometrySettings, imls: ImlsSettings, mut state: ImlsState) -> Self {
        let maps = Maps::load(&std::mem::take(&mut state.maps));
        let model = Model::load(std::mem::take(&mut state.model));
        Self { settings, imls, state, maps, model }
    }

    fn features(&self, sweep: &Sweep) -> SweepFeatures {
        let up = (self.state.begin.rotation.inverse() * Vector3::z()).cast();
        let axes = &self.state.begin.rotation;
        let sampling = self.settings.matching.sampling;
        SweepFeatures::new(sweep, &up, &self.settings.features, |features| sampled(features, sampling, axes, |_| true))
    }

    fn points(&self, sweep: &Sweep, end_from_begin: &Pose, odom_from_end: &Pose) -> SweepPoints {
        let ranges_m = self.settings.features.min_range_m..=self.settings.features.max_range_m;
        SweepPoints::new(sweep, end_from_begin, &odom_from_end.rotation, &ranges_m)
    }

    /// Keeps the first sweep until the second one is registered.
    fn wait(&mut self, features: SweepFeatures, sweep: &Sweep) {
        let points = self.points(sweep, &Pose::identity(), &self.state.begin);
        self.state.first = Some(First { features, points });
    }

    fn start(&mut self, first: &First, second: SweepFeatures, second_sweep: &Sweep) -> Vec<Registered> {
        let stamps = [first.features.mid_stamp, second.mid_stamp];
        let seconds = stamps[1].seconds_since(stamps[0]);
        let initial = InitialMotion::from_log(&self.state.log, stamps, &self.settings.mounting);
        let begin = &self.state.begin;
        let matching = &self.settings.matching;
        let Some(start) = initialize(&first.features, &second, seconds, begin, &initial, matching) else {
            // The motion is unknown: the second sweep becomes the first one, at the same pose.
            let at_rest = registered(&first.features, SweepMotion::still(self.state.begin), None);
            self.wait(second, second_sweep);
            return vec![at_rest];
        };
        let motion = start.first;
        self.insert(&first.points, &motion.begin(), &motion.end());
        self.grow(&first.features.features, &motion);
        let velocity = Velocity::between(&motion.mid, &start.second.motion.mid, seconds);
        let mounting = &self.settings.mounting;
        let velocity_in_body = mounting.body_from_lidar.rotation * velocity.linear;
        self.state.navigation = Some(Navigation::begin(&velocity_in_body, false, &self.state.log, stamps));
        let end = motion.end();
        let mid = motion.mid;
        let end_stamp = first.features.stamp.plus_nanos(i64::from(first.features.duration_nanos));
        let last = Last { end_stamp, end, velocity, mid_stamp: stamps[0], mid };
        let first = registered(&first.features, motion, Some(start.second));
        vec![first, self.follow(&second, second_sweep, &last)]
    }

    fn follow(&mut self, features: &SweepFeatures, sweep: &Sweep, last: &Last) -> Registered {
        let end_stamp = sweep.stamp().plus_nanos(i64::from(sweep.duration_nanos()));
        let seconds = end_stamp.seconds_since(last.end_stamp).max(MIN_SECONDS);
        let share_of_begin = 1.0 - features.duration_s / seconds;
        let begin_of = |end: &Pose| interpolate(&last.end, end, share_of_begin);
        let predicted = last.velocity.advance(&last.end, seconds);
        let end_from_begin = predicted.inverse() * begin_of(&predicted);
        let points = self.points(sweep, &end_from_begin, &predicted);
        let samples = self.samples(&points.features(&end_from_begin), &predicted);
        let matching = &self.settings.matching;
        let reported = Reported { min_influence: matching.min_influence, drift_residual_m: matching.drift_residual_m };
        let matched = match_samples(&samples, &self.model, &predicted, &self.imls, &reported);
        let end = matched.as_ref().map_or(predicted, |matched| matched.motion.mid);
        let motion = motion_between(&begin_of(&end), &end);
        let matched = matched.map(|matched| Matched { motion, ..matched });
        self.state.bridged_in_a_row = if matched.is_some() { 0 } else { self.state.bridged_in_a_row + 1 };
        let map_restarted = self.state.bridged_in_a_row >= MAX_BRIDGED && !points.is_empty();
        if map_restarted {
            self.model = Model::default();
            self.maps = Maps::default();
            self.state.bridged_in_a_row = 0;
            self.state.grown_at = None;
            self.state.moving = MovingDetector::default();
        }
        if matched.is_some() || map_restarted {
            self.insert(&points, &motion.begin(), &end);
        }
        let velocity = Velocity::between(&last.end, &end, seconds);
        let covariance = self.update_covariance(features, last, &motion, matched.as_ref());
        let moving = self.update_outputs(features, sweep, &motion, matched.is_some(), map_restarted);
        let mid_stamp = features.mid_stamp;
        let mid = motion.mid;
        self.state.last = Some(Last { end_stamp, end, velocity, mid_stamp, mid });
        Registered { map_restarted, covariance, moving, ..registered(features, motion, matched) }
    }

    /// Samples of the nine lists, from the points near the model at the predicted pose.
    fn samples(&self, points: &[Feature], predicted: &Pose) -> Vec<Feature> {
        let sampling = Sampling::NineLists { per_list: self.imls.per_list };
        sampled(points, sampling, &self.state.begin.rotation, |point| {
            let position = predicted * Point3::from(point.position).cast::<f64>();
            self.model.is_near(&position.coords, self.imls.radius_m)
        })
    }

    fn insert(&mut self, points: &SweepPoints, begin: &Pose, end: &Pose) {
        self.model.insert(self.state.n_inserted, &points.placed(begin, end), self.imls.sweeps);
        self.state.n_inserted += 1;
    }

    /// Propagates the covariance of the pose. The filter does not predict the pose.
    fn update_covariance(
        &mut self,
        features: &SweepFeatures,
        last: &Last,
        motion: &SweepMotion,
        matched: Option<&Matched>,
    ) -> Matrix6<f64> {
        let settings = &self.settings;
        let Some(navigation) = &mut self.state.navigation else { return Matrix6::zeros() };
        let stamps = [last.mid_stamp, features.mid_stamp];
        let mounting = &settings.mounting;
        let rate = &last.velocity.angular;
        let acceleration = settings.matching.acceleration;
        let prediction = navigation.predict(&mut self.state.log, mounting, &last.mid, stamps, acceleration, rate);
        let jitter = (settings.matching.drift_residual_m / settings.matching.residual_m).powi(2);
        let measurement = matched.map(|matched| StepMeasurement {
            information: matched.step_information * jitter,
            drift_information: matched.step_information,
        });
        navigation.update_step(mounting, [&last.mid, &motion.mid], &prediction, measurement.as_ref());
        navigation.pose_covariance()
    }

    /// Updates the moving points of the sweep and the map for loop closures.
    fn update_outputs(
        &mut self,
        features: &SweepFeatures,
        sweep: &Sweep,
        motion: &SweepMotion,
        is_matched: bool,
        map_restarted: bool,
    ) -> Vec<u32> {
        // Without a match the pose is too inaccurate: static objects would appear to move.
        let moving = if is_matched { self.state.moving.detect(sweep, motion) } else { MovingPoints::default() };
        if is_matched || map_restarted {
            let is_static = |feature: &&Feature| moving.points.binary_search(&feature.point_idx).is_err();
            let standing: Vec<Feature> = features.features.iter().filter(is_static).copied().collect();
            self.grow(&standing, motion);
        }
        if is_matched {
            self.state.moving.add_sweep(sweep, motion, &moving);
        }
        moving.points
    }

    fn grow(&mut self, features: &[Feature], motion: &SweepMotion) {
        let moved = self.state.grown_at.is_none_or(|at| {
            (at.translation.vector - motion.mid.translation.vector).norm() > MIN_MOTION_M
                || at.rotation.angle_to(&motion.mid.rotation) > MIN_ROTATION_RAD
        });
        if moved {
            self.maps.insert(self.state.n_grown, features, motion, &TurnLever::NONE, &self.settings.map);
            self.state.n_grown += 1;
            self.state.grown_at = Some(motion.mid);
        }
    }
}

/// Linear interpolation of the position and slerp of the rotation between the poses at the first and last shot.
fn motion_between(begin: &Pose, end: &Pose) -> SweepMotion {
    SweepMotion {
        mid: interpolate(begin, end, 0.5),
        translation: end.translation.vector - begin.translation.vector,
        rotation: (begin.rotation.inverse() * end.rotation).scaled_axis(),
    }
}

fn registered(features: &SweepFeatures, motion: SweepMotion, matched: Option<Matched>) -> Registered {
    Registered {
        stamp: features.stamp,
        duration_nanos: features.duration_nanos,
        motion,
        path: Vec::new(),
        matched,
        map_restarted: false,
        contrast: None,
        predicted_by: PredictionSources::default(),
        by_lidar: motion.mid,
        covariance: Matrix6::zeros(),
        moving: Vec::new(),
    }
}
