//! Scan-to-map odometry: registers each sweep to the local map.

mod acceptance;
mod distant;
pub(crate) mod initialization;
mod settings;
mod top_view;
mod upright_cost;
mod weak_track;
mod wide_match;

use crate::features::sampling::sampled;
use crate::features::sweep_features::SweepFeatures;
use crate::map::maps::{Maps, SavedMaps};
use crate::matching::rough_overlap::{AlongTrackSearch, rough_overlap};
use crate::matching::{Match, Prediction, match_features};
use crate::motion::Velocity;
use crate::moving_objects::{MovingDetector, MovingPoints};
use crate::observability::along_track::{
    MIN_CONTRAST, along_track_contrast, along_track_error, without_along_track_features,
};
use crate::observability::perturbation_test::supported_information;
use crate::prediction::navigation::{Navigation, PredictedPose, PredictionSources, StepMeasurement, straightening};
use crate::prediction::sensors::SensorLog;
use crate::self_calibration::ground_tilt::GroundTilt;
use crate::self_calibration::ring_errors::{RingError, RingErrors};
use crate::self_calibration::spin_direction::{TurnLever, TurnShare};
use crate::{
    Feature, GroundVelocity, InertialSample, Kernel, LocalMap, MatchSettings, Matched, Registered, RegistrationError,
    Revolution, Sampling, SpinDirection, Sweep, SweepMotion, Weights,
};
use acceptance::{is_plausible, is_reachable};
use distant::settings_at;
use geometry::{Pose, Stamp, Vector3};
use initialization::{InitialMotion, initialize};
use nalgebra::{Matrix6, Point3};
use serde::{Deserialize, Serialize};
pub use settings::OdometrySettings;
use weak_track::{AlongTrackMeasurement, AlongTrackPrior, MatchedSweep, WeakTrack};
use wide_match::PredictionError;

/// Lower limit like [`MatchSettings::min_influence`] for the features that do not face along the track: their only
/// along-track information comes from the edges of vehicles. Streets have 0.01 to 0.1 along the other directions.
const UNDISPUTED_INFLUENCE: f64 = 0.01;
/// Consecutive sweeps without a match (half a second) after which a new map begins: the old one may be out of reach.
const MAX_BRIDGED: u32 = 5;
/// Least motion or rotation of the vehicle since the last extension of the map: at a red light the map does not age and
/// the pose does not drift.
const MIN_MOTION_M: f64 = 0.1;
const MIN_ROTATION_RAD: f64 = 0.01;

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Last {
    mid_stamp: Stamp,
    mid: Pose,
    velocity: Velocity,
    /// Whether a match determined all directions of the pose.
    is_measured: bool,
}

/// The saved state, see [`Odometry::save`]. Its storage format must preserve the bits of floating-point numbers.
///
/// Size: at most twice [`MapSettings::max_points`](crate::MapSettings::max_points) map points of 44 bytes (smooth and rough ones), before the second
/// sweep the features of the first (at most three lists of one feature per range image cell and column step, 52 bytes
/// each), and the ranges of eight sweeps (2 bytes per ray). That is 7.5 MB with the defaults and 32 rings, and about 4
/// MB in a street.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OdometryState {
    begin: Pose,
    /// The z axis of odom in the LiDAR frame at the start.
    up_in_lidar: Vector3<f64>,
    /// The first sweep, until the second one is registered.
    first: Option<SweepFeatures>,
    last: Option<Last>,
    /// Pose of the last extension of the map.
    grown_at: Option<Pose>,
    next_batch: u32,
    bridged_in_a_row: u32,
    /// The filter; set from the first match on.
    navigation: Option<Navigation>,
    log: SensorLog,
    /// See [`Odometry::set_imu_probation`].
    imu_on_probation: bool,
    rings: RingErrors,
    ground_tilt: GroundTilt,
    turn: TurnShare,
    weak_track: WeakTrack,
    prediction_error: PredictionError,
    moving: MovingDetector,
    maps: SavedMaps,
}

/// Scan-to-map odometry. The same sweeps give the same bits on any number of threads and after any save and load.
#[derive(Debug)]
pub struct Odometry {
    settings: OdometrySettings,
    /// The saved part of the state. Its `maps` are empty while running: see the field below.
    state: OdometryState,
    maps: Maps,
}

impl Odometry {
    /// `odom_from_lidar` is the pose at the very first shot and defines the odom frame: with `body_from_lidar`, odom is
    /// the body frame at that moment. The x axis of odom must point forward; initial speeds are searched along it.
    pub fn new(settings: OdometrySettings, odom_from_lidar: Pose) -> Self {
        let state = OdometryState {
            begin: odom_from_lidar,
            up_in_lidar: odom_from_lidar.rotation.inverse() * Vector3::z(),
            first: None,
            last: None,
            grown_at: None,
            next_batch: 0,
            bridged_in_a_row: 0,
            navigation: None,
            log: SensorLog::default(),
            imu_on_probation: false,
            rings: RingErrors::default(),
            ground_tilt: GroundTilt::default(),
            turn: TurnShare::default(),
            weak_track: WeakTrack::default(),
            prediction_error: PredictionError::default(),
            moving: MovingDetector::default(),
            maps: SavedMaps::default(),
        };
        Self { settings, state, maps: Maps::default() }
    }

    /// Adds an inertial sample. Samples must be added in time order, before the sweep of their time. They predict the
    /// motion and have weight in the match; along degenerate directions the prediction is the result.
    pub fn add_imu(&mut self, sample: InertialSample) {
        self.state.log.push_inertial(sample);
    }

    /// Sets whether the inertial samples are on probation. Then the filter follows the matches with them, but they have no
    /// weight in a match and do not predict it, unless the last sweep had no match or a degenerate direction. A wrong unit
    /// so leaves the poses that it is compared with as they are by the LiDAR alone.
    pub fn set_imu_probation(&mut self, is_on_probation: bool) {
        self.state.imu_on_probation = is_on_probation;
    }

    /// Discards the inertial samples and the filter states estimated from them, because the samples were wrong.
    pub fn forget_imu(&mut self) {
        self.state.log.forget_inertial();
        if let (Some(navigation), Some(last)) = (&mut self.state.navigation, &self.state.last) {
            navigation.forget_inertial(&self.settings.mounting.body_from_lidar, &last.mid, &last.velocity.linear);
        }
    }

    /// Adds a GNSS velocity. Order and use are the same as in [`Odometry::add_imu`].
    pub fn add_gnss(&mut self, velocity: GroundVelocity) {
        self.state.log.push_velocity(velocity);
    }

    /// Registers the next sweep. Returns, in order, the sweeps whose motion is now known: no sweep for the first call
    /// (a speed needs two), both for the second, then each sweep immediately.
    pub fn register(&mut self, sweep: &Sweep) -> Result<Vec<Registered>, RegistrationError> {
        let features = self.features(sweep);
        let before = self.state.last.as_ref().map(|last| last.mid_stamp);
        if let Some(last) = before.or(self.state.first.as_ref().map(|first| first.mid_stamp))
            && features.mid_stamp <= last
        {
            return Err(RegistrationError::Order { last, got: features.mid_stamp });
        }
        if let Some(last) = self.state.last.take() {
            return Ok(vec![self.follow(&features, sweep, &last)]);
        }
        if let Some(first) = self.state.first.take() {
            return Ok(self.start(&first, features, sweep));
        }
        self.state.first = Some(features);
        Ok(Vec::new())
    }

    /// Returns the first sweep, at rest, if no second sweep was registered.
    pub fn finish(&mut self) -> Option<Registered> {
        let first = self.state.first.take()?;
        Some(registered(&first, SweepMotion::still(self.state.begin), None, false))
    }

    /// The current map of smooth surfaces.
    pub fn map(&self) -> &LocalMap {
        &self.maps.smooth
    }

    /// Errors of the sensor's rings per row of the range image, the lowest ring first; empty if the points have no
    /// rings.
    pub fn ring_errors(&self) -> Vec<RingError> {
        self.state.rings.by_row().to_vec()
    }

    /// Spin direction of the sensor, once it has been determined from the sweeps without point times.
    pub fn turning(&self) -> Option<SpinDirection> {
        self.state.turn.direction().filter(|_| self.settings.untimed_turn_s.is_some())
    }

    /// The revolution of the next sweep, see [`Sweep::spinning`]. Its time is at most the time since the last sweep.
    pub fn turning_at(&self, stamp: Stamp) -> Option<Revolution> {
        let since_last = stamp.seconds_since(self.state.last.as_ref()?.mid_stamp);
        let turn_s = self.settings.untimed_turn_s?.min(since_last);
        let revolution = |spin| Revolution { spin, duration_nanos: (turn_s * 1e9) as u32 };
        self.turning().filter(|_| turn_s > 0.0).map(revolution)
    }

    /// The state on which the following sweeps depend.
    pub fn save(&self) -> OdometryState {
        OdometryState { maps: self.maps.save(), ..self.state.clone() }
    }

    /// Continues from a state of [`Odometry::save`].
    pub fn load(settings: OdometrySettings, mut state: OdometryState) -> Self {
        let maps = Maps::load(&std::mem::take(&mut state.maps));
        Self { settings, state, maps }
    }

    fn features(&self, sweep: &Sweep) -> SweepFeatures {
        let up = self.state.up_in_lidar.cast();
        let mut found =
            SweepFeatures::new(sweep, &up, &self.settings.features, |features| self.sampled(features, |_| true));
        // Elevation bins are not lasers: they have no individual errors.
        if sweep.image().has_rings() {
            for features in [&mut found.features, &mut found.matching, &mut found.with_rough] {
                self.state.rings.correct(features);
            }
        }
        found
    }

    fn start(&mut self, first: &SweepFeatures, second: SweepFeatures, second_sweep: &Sweep) -> Vec<Registered> {
        let seconds = second.mid_stamp.seconds_since(first.mid_stamp);
        let settings = &self.settings.matching;
        let initial =
            InitialMotion::from_log(&self.state.log, [first.mid_stamp, second.mid_stamp], &self.settings.mounting);
        let start = initialize(first, &second, seconds, &self.state.begin, &initial, settings)
            .filter(|start| is_plausible(&start.second, seconds));
        let Some(start) = start else {
            // The motion is unknown: the second sweep becomes the first one, at the same pose.
            let at_rest = registered(first, SweepMotion::still(self.state.begin), None, false);
            self.state.first = Some(second);
            return vec![at_rest];
        };
        let turn = self.turn_lever(first, &start.first.mid, &start.second.motion.mid, seconds);
        self.grow(&first.features, &start.first, &turn);
        let velocity = Velocity::between(&start.first.mid, &start.second.motion.mid, seconds);
        let is_measured = is_measured(Some(&start.second), None);
        let last = Last { mid_stamp: first.mid_stamp, mid: start.first.mid, velocity, is_measured };
        let velocity_in_body = self.settings.mounting.body_from_lidar.rotation * velocity.linear;
        let stamps = [first.mid_stamp, second.mid_stamp];
        let navigation = Navigation::begin(&velocity_in_body, initial.speed.is_some(), &self.state.log, stamps);
        self.state.navigation = Some(navigation);
        let prediction = self.predict(&last, second.mid_stamp);
        let first_match = start.second.clone();
        let first = registered(first, start.first, Some(first_match), false);
        let estimate =
            Estimate { motion: start.second.motion, matched: Some(start.second), contrast: None, along_track: None };
        let second = self.update(&second, second_sweep, estimate, &last, &prediction);
        vec![first, second]
    }

    /// The predicted pose of the LiDAR at `mid_stamp`.
    fn predict(&mut self, last: &Last, mid_stamp: Stamp) -> PredictedPose {
        let acceleration = self.settings.matching.acceleration;
        let seconds = mid_stamp.seconds_since(last.mid_stamp);
        let log = &mut self.state.log;
        let prediction = self.state.navigation.as_mut().map(|navigation| {
            let stamps = [last.mid_stamp, mid_stamp];
            let rate = &last.velocity.angular;
            navigation.predict(log, &self.settings.mounting, &last.mid, stamps, acceleration, rate)
        });
        let constant_motion = || PredictedPose {
            mid: last.velocity.advance(&last.mid, seconds),
            information: Matrix6::zeros(),
            sources: PredictionSources::default(),
        };
        let is_filtered = self.state.weak_track.is_measurable();
        let prediction =
            prediction.filter(|prediction| prediction.sources.is_any() || is_filtered).unwrap_or_else(constant_motion);
        let is_withheld = prediction.sources.inertial && self.state.imu_on_probation && last.is_measured;
        if is_withheld { PredictedPose { sources: prediction.sources, ..constant_motion() } } else { prediction }
    }

    /// Registers a sweep to the map, starting from the motion of the previous sweep. Equation numbers refer to
    /// `matching.rs`, section numbers to IMLS-SLAM (J.-E. Deschaud, ICRA 2018).
    fn follow(&mut self, features: &SweepFeatures, sweep: &Sweep, last: &Last) -> Registered {
        let seconds = features.mid_stamp.seconds_since(last.mid_stamp);

        // 1. Prediction (III): the last velocity continues, or the filter of inertial unit and receiver predicts the pose. The
        //    motion between the two poses is the motion during the sweep, which deskews it. Where the last matches hardly
        //    constrained the along-track position, rough surfaces measure it.
        let predicted = self.predict(last, features.mid_stamp);
        let by_sensors = self.match_prediction(features, last, &predicted, seconds);
        let measured = self.along_track_measurement(features, last, &predicted, &by_sensors.motion);

        // 2. Sampling (III-C): evenly in space during feature extraction, or nine lists near the map at the predicted
        //   pose.
        let near_map = match self.settings.matching.sampling {
            Sampling::NineLists { .. } => Some(self.near_map(features, &by_sensors.motion)),
            Sampling::Even { .. } => None,
        };
        let samples = near_map.as_ref().unwrap_or(&features.matching);

        // 3. Matching (III-D, equations 1 to 5). Planar features first. If they leave a direction nearly unconstrained,
        //   rough features are added.
        let settings = settings_at(&self.settings.matching, seconds);
        let matching = |samples, prediction| match_features(samples, &self.maps, prediction, &settings);
        let is_poor = |found: &Option<Match>| {
            found.as_ref().is_none_or(|found| found.matched.least_influence < self.settings.matching.rough_below)
        };
        let mut matched_by = samples;
        let mut found = matching(matched_by, &by_sensors);
        if near_map.is_none() && is_poor(&found) && features.with_rough.len() > features.matching.len() {
            matched_by = &features.with_rough;
            found = matching(matched_by, &by_sensors);
        }
        //   A match that contradicts the overlap follows vehicles that move along: from there on, the overlap decides.
        let matched = found.as_ref().map(|found| &found.matched.motion);
        let weak_track = &self.state.weak_track;
        let mut along_track =
            measured.filter(|measured| weak_track.is_decided_by(measured, &by_sensors.motion, matched));
        let prediction = along_track.as_ref().map_or(by_sensors, |measured| measured.applied_to(&by_sensors));
        if along_track.is_some() {
            matched_by = &features.with_rough;
            found = matching(matched_by, &prediction);
        }

        // 4. Acceptance: the match must have converged with enough small residuals, within the acceleration limits of a
        //   vehicle. Otherwise the prediction replaces it.
        let is_acceptable = |Match { matched, .. }: &Match| {
            is_plausible(matched, seconds) && is_reachable(&matched.motion.mid, &prediction.motion.mid, seconds)
        };
        let mut found = found.filter(is_acceptable);
        if near_map.is_none()
            && let Some(wide) = self.wide_match(features, matched_by, last, &prediction, found.as_ref())
        {
            along_track = None;
            found = Some(wide);
        }

        // 5. Along-track observability: in traffic at its own speed the vehicle appears to stand. If the scene does not
        //   constrain the along-track position, the sweep is matched again without the features that face along the
        //   track, and the sensors determine the position.
        let forward = self.forward();
        let contrast = found.as_ref().and_then(|found| {
            along_track_contrast(&forward, samples, &self.maps, &found.matched.motion, &self.settings.matching)
        });
        let is_contested = contrast.is_some_and(|contrast| contrast < MIN_CONTRAST);
        if is_contested && predicted.sources.is_any() {
            along_track = None;
            let undisputed = without_along_track_features(&forward, samples);
            let settings = MatchSettings { min_influence: UNDISPUTED_INFLUENCE, ..self.settings.matching.clone() };
            let again = match_features(&undisputed, &self.maps, &by_sensors, &settings);
            found = again.filter(is_acceptable).or(found);
        }

        // 6. Perturbation test: only information that a shifted sweep confirms enters the covariance.
        if let Some(Match { matched, .. }) = &mut found {
            let settings = &self.settings.matching;
            let motion = matched.motion;
            matched.step_information = supported_information(matched, matched_by, &self.maps, &motion, settings);
        }

        // 7. Self-calibration: the nuisance parameters of equation 1 become the prior of the next sweep.
        let motion = found.as_ref().map_or(prediction.motion, |found| found.matched.motion);
        if let Some(found) = &found {
            self.calibrate(features, sweep, &motion, found);
        }

        // 8. Filter, moving objects and map.
        let matched = found.map(|found| found.matched);
        let forward = motion.mid.rotation * forward;
        let is_left_to_receiver = is_contested && predicted.sources.receiver;
        self.state.weak_track.update(&MatchedSweep {
            matched: matched.as_ref(),
            forward,
            turn_radps: Velocity::between(&last.mid, &motion.mid, seconds).angular.norm(),
            is_left_to_receiver,
            is_by_overlap: along_track.is_some(),
        });
        let matched_at = matched.as_ref().map(|matched| &matched.motion.mid);
        self.state.prediction_error.update(&by_sensors.motion.mid, matched_at, seconds);
        let estimate = Estimate { motion, matched, contrast, along_track };
        self.update(features, sweep, estimate, last, &predicted)
    }

    /// Prior of the match of a sweep, from the predicted pose `seconds` after the last one.
    fn match_prediction(
        &self,
        features: &SweepFeatures,
        last: &Last,
        predicted: &PredictedPose,
        seconds: f64,
    ) -> Prediction {
        let velocity = Velocity::between(&last.mid, &predicted.mid, seconds);
        let way_m = (predicted.mid.translation.vector - last.mid.translation.vector).norm();
        Prediction {
            motion: velocity.motion_at(predicted.mid, features.duration_s),
            previous: last.mid,
            seconds,
            duration_s: features.duration_s,
            information: predicted.information,
            ground_tilt: self.state.ground_tilt.advanced(way_m, self.state.rings.significant_rad()),
            elevation: self.state.rings.rest(),
            turn: self.state.turn,
            turn_lever: self.turn_lever(features, &last.mid, &predicted.mid, seconds),
        }
    }

    /// The along-track position by the overlap of rough surfaces, where the last matches hardly constrained it.
    fn along_track_measurement(
        &self,
        features: &SweepFeatures,
        last: &Last,
        predicted: &PredictedPose,
        motion: &SweepMotion,
    ) -> Option<AlongTrackMeasurement> {
        let navigation = self.state.navigation.as_ref().filter(|_| self.state.weak_track.is_measurable())?;
        let forward = motion.mid.rotation * self.forward();
        let variance = navigation.step_variance(&self.settings.mounting, &last.mid, &forward);
        let is_inertial = predicted.sources.inertial && !self.state.imu_on_probation;
        let prior = AlongTrackPrior::from_step(variance, is_inertial);
        let search = AlongTrackSearch { forward, reach_m: prior.reach_m() };
        let overlap = rough_overlap(&search, &features.with_rough, &self.maps, motion, &self.settings.matching)?;
        Some(AlongTrackMeasurement::new(&forward, prior, overlap))
    }

    /// Direction of travel, LiDAR axes.
    fn forward(&self) -> Vector3<f64> {
        self.state.begin.rotation.inverse() * Vector3::x()
    }

    /// Stores the sensor errors that were estimated in a match.
    fn calibrate(&mut self, features: &SweepFeatures, sweep: &Sweep, motion: &SweepMotion, found: &Match) {
        self.state.ground_tilt = found.ground_tilt;
        // At rest each sweep repeats the same measurement.
        if self.has_moved(motion) {
            if features.duration_nanos == 0 {
                self.state.turn = found.turn;
            }
            if sweep.image().has_rings() {
                self.state.rings.update_common(&found.elevation);
                self.state.rings.update(&found.rings);
            }
        }
    }

    /// A sample of the features that are near the map under this motion.
    fn near_map(&self, features: &SweepFeatures, motion: &SweepMotion) -> Vec<Feature> {
        let matching = &self.settings.matching;
        let radius_m = if matching.coarse_rounds > 0 { matching.coarse.radius_m } else { matching.fine.radius_m };
        let kernel = Kernel { radius_m, weights: Weights::Compact };
        self.sampled(&features.features, |feature| {
            let pose = motion.at(f64::from(feature.share));
            let position = pose * Point3::from(feature.position).cast::<f64>();
            let normal = pose.rotation * Vector3::from(feature.normal).cast::<f64>();
            self.maps.map_for(feature).surface(position.coords.into(), &normal.cast(), &kernel).is_some()
        })
    }

    fn sampled(&self, features: &[Feature], is_near_model: impl Fn(&Feature) -> bool) -> Vec<Feature> {
        sampled(features, self.settings.matching.sampling, &self.state.begin.rotation, is_near_model)
    }

    /// Updates filter, map and moving objects with the motion of a sweep.
    fn update(
        &mut self,
        features: &SweepFeatures,
        sweep: &Sweep,
        Estimate { motion, matched, contrast, along_track }: Estimate,
        last: &Last,
        prediction: &PredictedPose,
    ) -> Registered {
        let seconds = features.mid_stamp.seconds_since(last.mid_stamp);
        let settings = &self.settings.matching;
        if let Some(navigation) = &mut self.state.navigation {
            let jitter = (settings.drift_residual_m / settings.residual_m).powi(2);
            let measurement = matched.as_ref().map(|matched| StepMeasurement {
                information: matched.step_information * jitter,
                drift_information: matched.step_information,
            });
            let measurement = measurement.map(|found| match &along_track {
                Some(along_track) => along_track.replaced_in(&found),
                None => found,
            });
            let step = [&last.mid, &motion.mid];
            let weighted = along_track.as_ref().map(|along_track| along_track.weighted(prediction));
            let weighted = weighted.as_ref().unwrap_or(prediction);
            navigation.update_step(&self.settings.mounting, step, weighted, measurement.as_ref());
            navigation.update_standstill(&self.state.log, features.mid_stamp);
            if let Some(matched) = &matched {
                navigation.add_error(&along_track_error(step, contrast, matched.least_influence));
            }
        }
        let by_lidar = matched.as_ref().map_or(motion.mid, |matched| {
            let information = matched.information * (matched.rms_m / settings.residual_m).powi(2);
            prediction.removed_from(&motion.mid, &information)
        });
        let mut velocity = match &matched {
            Some(_) if features.duration_nanos > 0 => Velocity::during(&motion, features.duration_s),
            _ => Velocity::between(&last.mid, &motion.mid, seconds),
        };
        if matched.as_ref().is_some_and(|matched| matched.n_degenerate_directions > 0) {
            velocity.angular *= straightening(seconds);
        }
        let is_measured = is_measured(matched.as_ref(), contrast);
        self.state.last = Some(Last { mid_stamp: features.mid_stamp, mid: motion.mid, velocity, is_measured });
        self.state.bridged_in_a_row = if matched.is_some() { 0 } else { self.state.bridged_in_a_row + 1 };
        let map_restarted = self.state.bridged_in_a_row >= MAX_BRIDGED && !features.features.is_empty();
        if map_restarted {
            self.maps = Maps::default();
            self.state.bridged_in_a_row = 0;
            self.state.grown_at = None;
            self.state.moving = MovingDetector::default();
        }
        // Without a match the pose is too inaccurate: static objects would appear to move.
        let moving = if matched.is_some() { self.state.moving.detect(sweep, &motion) } else { MovingPoints::default() };
        if map_restarted || matched.is_some() {
            let is_static = |feature: &&Feature| moving.points.binary_search(&feature.point_idx).is_err();
            let standing: Vec<Feature> = features.features.iter().filter(is_static).copied().collect();
            let turn = self.turn_lever(features, &last.mid, &motion.mid, seconds);
            self.grow(&standing, &motion, &turn);
        }
        if matched.is_some() {
            self.state.moving.add_sweep(sweep, &motion, &moving);
        }
        Registered {
            contrast,
            moving: moving.points,
            covariance: self.state.navigation.as_ref().map_or_else(Matrix6::zeros, Navigation::pose_covariance),
            predicted_by: prediction.sources,
            by_lidar,
            ..registered(features, motion, matched, map_restarted)
        }
    }

    /// Whether the vehicle has moved or rotated since the last extension of the map.
    fn has_moved(&self, motion: &SweepMotion) -> bool {
        self.state.grown_at.is_none_or(|at| {
            (at.translation.vector - motion.mid.translation.vector).norm() > MIN_MOTION_M
                || at.rotation.angle_to(&motion.mid.rotation) > MIN_ROTATION_RAD
        })
    }

    /// The lever of a sweep without point times, for a motion between poses `seconds` apart.
    fn turn_lever(&self, features: &SweepFeatures, from: &Pose, to: &Pose, seconds: f64) -> TurnLever {
        let turn_s = self.settings.untimed_turn_s.filter(|_| features.duration_nanos == 0);
        turn_s.map_or(TurnLever::NONE, |turn_s| TurnLever::between(from, to, seconds, turn_s.min(seconds)))
    }

    fn grow(&mut self, features: &[Feature], motion: &SweepMotion, turn: &TurnLever) {
        if self.has_moved(motion) {
            let batch = self.state.next_batch;
            self.maps.insert(batch, features, motion, turn, &self.settings.map);
            self.state.next_batch += 1;
            self.state.grown_at = Some(motion.mid);
        }
    }
}

/// The motion of a sweep and its source.
struct Estimate {
    motion: SweepMotion,
    /// `None`: the motion is the prediction.
    matched: Option<Matched>,
    /// See [`Registered::contrast`].
    contrast: Option<f64>,
    /// The along-track position, where rough surfaces measured it.
    along_track: Option<AlongTrackMeasurement>,
}

fn registered(
    features: &SweepFeatures,
    motion: SweepMotion,
    matched: Option<Matched>,
    map_restarted: bool,
) -> Registered {
    Registered {
        stamp: features.stamp,
        duration_nanos: features.duration_nanos,
        motion,
        path: Vec::new(),
        matched,
        map_restarted,
        contrast: None,
        predicted_by: PredictionSources::default(),
        by_lidar: motion.mid,
        covariance: Matrix6::zeros(),
        moving: Vec::new(),
    }
}

/// Whether the scene determines all directions of a pose.
fn is_measured(matched: Option<&Matched>, contrast: Option<f64>) -> bool {
    matched.is_some_and(|matched| matched.n_degenerate_directions == 0)
        && contrast.is_none_or(|contrast| contrast >= MIN_CONTRAST)
}
