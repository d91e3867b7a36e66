//! Sweep after sweep onto the local map.

use crate::maps::{Maps, SavedMaps};
use crate::matching::{Prediction, match_features};
use crate::motion::Velocity;
use crate::moving::{Moving, MovingObjects};
use crate::navigation::{Foretold, Lean, Navigation, StepMeasure};
use crate::sampling::sampled;
use crate::sensors::SensorLog;
use crate::start::{FirstMotion, find_start};
use crate::{
    Feature, FeatureSettings, GroundVelocity, InertialSample, Kernel, LocalMap, MapSettings, MatchSettings, Matched,
    Sampling, SensorPlaces, Sweep, SweepMotion, Weights, planar_features,
};
use geometry::{Pose, Stamp, Vector3};
use nalgebra::{Matrix6, Point3};
use serde::{Deserialize, Serialize};

/// Settings of all steps. The parts say why their defaults are what they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OdometrySettings {
    /// Which points are features.
    pub features: FeatureSettings,
    /// Extent of the map.
    pub map: MapSettings,
    /// Matching.
    pub matching: MatchSettings,
    /// Where the sensors are whose measurements come along.
    pub places: SensorPlaces,
}

/// Share of the features that must find the map for a match to count. New ground takes 10 to 20 % away at 10 m/s.
const MIN_MATCHED_SHARE: f64 = 0.3;
/// Largest root mean square distance from the map's planes: five times range noise.
const MAX_RMS_M: f64 = 0.12;
/// Largest jump off the prediction: 15 m/s^2 and 10 rad/s^2, more than a crash test's vehicle does on a road, plus what
/// a coarse round may shift at any time.
const MAX_JUMP_MPS2: f64 = 15.0;
const MAX_JUMP_RADPS2: f64 = 10.0;
const JUMP_SLACK_M: f64 = 0.5;
const JUMP_SLACK_RAD: f64 = 0.05;
/// After so many bridged sweeps (half a second) the old map may be out of reach: a new one is begun.
const MAX_BRIDGED: u32 = 5;
/// The map grows only when the vehicle has moved this far or turned this much since it grew last: at a red light
/// neither does the map age nor the pose drift.
const MIN_WAY_M: f64 = 0.1;
const MIN_TURN_RAD: f64 = 0.01;

/// A sweep in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Registered {
    /// Time of the first shot.
    pub stamp: Stamp,
    /// ns from first to last shot.
    pub duration_nanos: u32,
    /// `odom_from_lidar` over the sweep.
    pub motion: SweepMotion,
    /// The match; `None` if there was none to be trusted and the sweep follows what was foretold (or, for a first sweep that
    /// found no second, rest was assumed).
    pub matched: Option<Matched>,
    /// What foretold the motion; where the scene determines nothing, it is the motion.
    pub lean: Lean,
    /// A new map was begun with this sweep because the old one was lost.
    pub map_restarted: bool,
    /// Covariance of the pose in the middle of the sweep: translation (m), then rotation (rad), in odom axes about the lidar.
    /// It grows from zero at the first sweep, slowly where the scene determines the way, fast where nothing does.
    pub covariance: Matrix6<f64>,
    /// Indices of the sweep's points on things that move, rising: they stand where an earlier sweep saw through. Things that
    /// have only just come into view are not known to move.
    pub moving: Vec<u32>,
}

impl Registered {
    /// `odom_from_lidar` at the first shot.
    pub fn begin(&self) -> Pose {
        self.motion.begin()
    }
    /// `odom_from_lidar` at the last shot.
    pub fn end(&self) -> Pose {
        self.motion.end()
    }
    /// Whether what was foretold stands in for a match.
    pub fn is_bridged(&self) -> bool {
        self.matched.is_none()
    }
}

/// Why a sweep cannot be taken.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RegistrationError {
    /// Sweeps come in the order of time.
    #[error("sweep of {got} follows that of {last}: the middle of a sweep must be later than that of the one before")]
    Order {
        /// Middle of the sweep before.
        last: Stamp,
        /// Middle of this sweep.
        got: Stamp,
    },
}

/// Features of a sweep, without its points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct HeldSweep {
    stamp: Stamp,
    mid_stamp: Stamp,
    duration_nanos: u32,
    pub duration_s: f64,
    /// All, for the map.
    pub features: Vec<Feature>,
    /// Some of the smooth ones, for matching, without regard to a map.
    pub matching: Vec<Feature>,
    /// Those and some of the rough ones.
    with_rough: Vec<Feature>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Last {
    mid_stamp: Stamp,
    mid: Pose,
    velocity: Velocity,
}

/// Everything that the next sweep depends on, see [`Odometry::save`]. Numbers keep their bits in any format that does.
///
/// At most twice [`MapSettings::max_points`] map points of 40 bytes (smooth and rough ones), before the second sweep the
/// features of the first (at most three lists of one feature per range image cell and column step, 44 bytes each), and the
/// ranges of eight sweeps (2 bytes a ray): 7.5 MB with the defaults and 32 rings, as a street fills them about 4 MB.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OdometryState {
    begin: Pose,
    /// The z axis of odom in the lidar frame, at the begin.
    up_in_lidar: Vector3<f64>,
    held: Option<HeldSweep>,
    last: Option<Last>,
    /// Where the map grew last.
    grown_at: Option<Pose>,
    next_batch: u32,
    bridged_in_a_row: u32,
    /// From the first match on.
    navigation: Option<Navigation>,
    log: SensorLog,
    moving: MovingObjects,
    maps: SavedMaps,
}

/// Scan-to-map odometry. Same sweeps, same poses, to the bit, on any number of threads and after any save and load.
#[derive(Debug)]
pub struct Odometry {
    settings: OdometrySettings,
    /// `maps` is empty while running: see the other field.
    state: OdometryState,
    maps: Maps,
}

impl Odometry {
    /// `odom_from_lidar` is the pose at the very first shot. Its frame decides what odom is: with `body_from_lidar`,
    /// odom is the body frame at that moment. The x axis of odom must point forward; the start is searched along it.
    pub fn new(settings: OdometrySettings, odom_from_lidar: Pose) -> Self {
        let state = OdometryState {
            begin: odom_from_lidar,
            up_in_lidar: odom_from_lidar.rotation.inverse() * Vector3::z(),
            held: None,
            last: None,
            grown_at: None,
            next_batch: 0,
            bridged_in_a_row: 0,
            navigation: None,
            log: SensorLog::default(),
            moving: MovingObjects::default(),
            maps: SavedMaps::default(),
        };
        Self { settings, state, maps: Maps::default() }
    }

    /// Takes an inertial sample, in the order of time, before the sweep in whose time it lies. Samples and velocities foretell the
    /// motion: the pose is the most likely one by all. Where the scene determines nothing it is the foretold one.
    pub fn feel(&mut self, sample: InertialSample) {
        self.state.log.push_inertial(sample);
    }

    /// Takes a receiver's velocity, in the order of time, as [`Odometry::feel`] takes samples.
    pub fn hear(&mut self, velocity: GroundVelocity) {
        self.state.log.push_velocity(velocity);
    }

    /// Takes the next sweep and gives back, in order, the sweeps whose motion is known now: none for the first (a speed
    /// needs two), both for the second, from then on each at once.
    pub fn register(&mut self, sweep: &Sweep) -> Result<Vec<Registered>, RegistrationError> {
        let full = sweep;
        let sweep = self.hold(sweep);
        let before = self.state.last.as_ref().map(|last| last.mid_stamp);
        if let Some(last) = before.or(self.state.held.as_ref().map(|held| held.mid_stamp))
            && sweep.mid_stamp <= last
        {
            return Err(RegistrationError::Order { last, got: sweep.mid_stamp });
        }
        if let Some(last) = self.state.last.take() {
            return Ok(vec![self.follow(&sweep, full, &last)]);
        }
        if let Some(first) = self.state.held.take() {
            return Ok(self.start(&first, sweep, full));
        }
        self.state.held = Some(sweep);
        Ok(Vec::new())
    }

    /// The first sweep if no second ever came: at rest.
    pub fn finish(&mut self) -> Option<Registered> {
        let held = self.state.held.take()?;
        Some(held.registered(SweepMotion::still(self.state.begin), None, false))
    }

    /// The map of smooth surfaces as it is now.
    pub fn map(&self) -> &LocalMap {
        &self.maps.smooth
    }

    /// Everything that the next sweep depends on.
    pub fn save(&self) -> OdometryState {
        OdometryState { maps: self.maps.save(), ..self.state.clone() }
    }

    /// The odometry that [`Odometry::save`] wrote.
    pub fn load(settings: OdometrySettings, mut state: OdometryState) -> Self {
        let maps = Maps::load(&std::mem::take(&mut state.maps));
        Self { settings, state, maps }
    }

    fn hold(&self, sweep: &Sweep) -> HeldSweep {
        let up = self.state.up_in_lidar.cast();
        let features = planar_features(sweep, &up, &self.settings.features);
        let (smooth, rough) = features.split_at(features.partition_point(|feature| !feature.is_rough));
        let matching = self.sampled(smooth, |_| true);
        let with_rough = matching.iter().copied().chain(self.sampled(rough, |_| true)).collect();
        HeldSweep {
            stamp: sweep.stamp(),
            mid_stamp: sweep.mid_stamp(),
            duration_nanos: sweep.duration_nanos(),
            duration_s: f64::from(sweep.duration_nanos()) * 1e-9,
            matching,
            with_rough,
            features,
        }
    }

    fn start(&mut self, first: &HeldSweep, second: HeldSweep, full: &Sweep) -> Vec<Registered> {
        let seconds = second.mid_stamp.seconds_since(first.mid_stamp);
        let settings = &self.settings.matching;
        let told = FirstMotion::of(&self.state.log, [first.mid_stamp, second.mid_stamp], &self.settings.places);
        let start = find_start(first, &second, seconds, &self.state.begin, &told, settings)
            .filter(|start| is_plausible(&start.second));
        let Some(start) = start else {
            // The second is the next one's first, from the same place: nothing is known of the motion.
            let unmoved = first.registered(SweepMotion::still(self.state.begin), None, false);
            self.state.held = Some(second);
            return vec![unmoved];
        };
        self.grow(&first.features, &start.first);
        let velocity = Velocity::between(&start.first.mid, &start.second.motion.mid, seconds);
        let last = Last { mid_stamp: first.mid_stamp, mid: start.first.mid, velocity };
        let velocity_in_body = self.settings.places.body_from_lidar.rotation * velocity.linear;
        let stamps = [first.mid_stamp, second.mid_stamp];
        let navigation = Navigation::begin(&velocity_in_body, told.speed.is_some(), &self.state.log, stamps);
        self.state.navigation = Some(navigation);
        let foretold = self.foretell(&last, second.mid_stamp);
        let first_match = start.second.clone();
        let first = first.registered(start.first, Some(first_match), false);
        let second = self.arrive(&second, full, (start.second.motion, Some(start.second)), &last, &foretold);
        vec![first, second]
    }

    /// Where the lidar will be at `mid_stamp`.
    fn foretell(&mut self, last: &Last, mid_stamp: Stamp) -> Foretold {
        let acceleration = self.settings.matching.acceleration;
        let seconds = mid_stamp.seconds_since(last.mid_stamp);
        let log = &mut self.state.log;
        let foretold = self.state.navigation.as_mut().map(|navigation| {
            let (stamps, rate) = ([last.mid_stamp, mid_stamp], &last.velocity.angular);
            navigation.foretell(log, &self.settings.places, &last.mid, stamps, acceleration, rate)
        });
        let as_before = || Foretold {
            mid: last.velocity.advance(&last.mid, seconds),
            information: Matrix6::zeros(),
            lean: Lean::default(),
        };
        foretold.filter(|foretold| foretold.lean.is_any()).unwrap_or_else(as_before)
    }

    fn follow(&mut self, sweep: &HeldSweep, full: &Sweep, last: &Last) -> Registered {
        let seconds = sweep.mid_stamp.seconds_since(last.mid_stamp);
        let foretold = self.foretell(last, sweep.mid_stamp);
        let velocity = Velocity::between(&last.mid, &foretold.mid, seconds);
        let prediction = Prediction {
            motion: velocity.motion_at(foretold.mid, sweep.duration_s),
            previous: (last.mid, seconds),
            duration_s: sweep.duration_s,
            information: foretold.information,
        };
        let gated = match self.settings.matching.sampling {
            Sampling::NineLists { .. } => Some(self.near_map(sweep, &prediction.motion)),
            Sampling::Even { .. } => None,
        };
        let samples = gated.as_ref().unwrap_or(&sweep.matching);
        let matching = |samples| match_features(samples, &self.maps, &prediction, &self.settings.matching);
        let is_poor = |matched: &Option<Matched>| {
            matched.as_ref().is_none_or(|m| m.weakest_influence < self.settings.matching.rough_below)
        };
        let mut matched = matching(samples);
        if gated.is_none() && is_poor(&matched) && sweep.with_rough.len() > sweep.matching.len() {
            matched = matching(&sweep.with_rough);
        }
        let matched = matched
            .filter(|matched| is_plausible(matched) && is_reachable(&matched.motion.mid, &foretold.mid, seconds));
        let motion = matched.as_ref().map_or(prediction.motion, |matched| matched.motion);
        self.arrive(sweep, full, (motion, matched), last, &foretold)
    }

    /// The samples of a sweep that are near the map where the motion puts them.
    fn near_map(&self, sweep: &HeldSweep, motion: &SweepMotion) -> Vec<Feature> {
        let matching = &self.settings.matching;
        let radius_m = if matching.coarse_rounds > 0 { matching.coarse.0 } else { matching.fine.0 };
        let kernel = Kernel { radius_m, weights: Weights::Compact };
        self.sampled(&sweep.features, |feature| {
            let pose = motion.at(f64::from(feature.share));
            let position = pose * Point3::from(feature.position).cast::<f64>();
            let normal = pose.rotation * Vector3::from(feature.normal).cast::<f64>();
            self.maps.of(feature).surface(position.coords.into(), &normal.cast(), &kernel).is_some()
        })
    }

    fn sampled(&self, features: &[Feature], is_near_model: impl Fn(&Feature) -> bool) -> Vec<Feature> {
        sampled(features, self.settings.matching.sampling, &self.state.begin.rotation, is_near_model)
    }

    /// Books the sweep's motion, and grows the map by it if it was matched.
    fn arrive(
        &mut self,
        sweep: &HeldSweep,
        full: &Sweep,
        (motion, matched): (SweepMotion, Option<Matched>),
        last: &Last,
        foretold: &Foretold,
    ) -> Registered {
        let seconds = sweep.mid_stamp.seconds_since(last.mid_stamp);
        let settings = &self.settings.matching;
        if let Some(navigation) = &mut self.state.navigation {
            let jumps = (settings.drift_residual_m / settings.residual_m).powi(2);
            let measure = matched.as_ref().map(|matched| StepMeasure {
                information: matched.step_information * jumps,
                drift_information: matched.step_information,
            });
            let step = [&last.mid, &motion.mid];
            navigation.arrive(&self.settings.places, step, foretold, measure.as_ref());
            navigation.stand(&self.state.log, sweep.mid_stamp);
        }
        let velocity = match &matched {
            Some(_) if sweep.duration_nanos > 0 => Velocity::during(&motion, sweep.duration_s),
            _ => Velocity::between(&last.mid, &motion.mid, seconds),
        };
        self.state.last = Some(Last { mid_stamp: sweep.mid_stamp, mid: motion.mid, velocity });
        self.state.bridged_in_a_row = if matched.is_some() { 0 } else { self.state.bridged_in_a_row + 1 };
        let map_restarted = self.state.bridged_in_a_row >= MAX_BRIDGED && !sweep.features.is_empty();
        if map_restarted {
            self.maps = Maps::default();
            self.state.bridged_in_a_row = 0;
            self.state.grown_at = None;
            self.state.moving = MovingObjects::default();
        }
        // A sweep that only follows the last motion would make standing things move.
        let moving = if matched.is_some() { self.state.moving.found(full, &motion) } else { Moving::default() };
        if map_restarted || matched.is_some() {
            let stands = |feature: &&Feature| moving.points.binary_search(&feature.point_idx).is_err();
            let standing: Vec<Feature> = sweep.features.iter().filter(stands).copied().collect();
            self.grow(&standing, &motion);
        }
        if matched.is_some() {
            self.state.moving.remember(full, &motion, &moving);
        }
        Registered {
            moving: moving.points,
            covariance: self.state.navigation.as_ref().map_or_else(Matrix6::zeros, Navigation::pose),
            lean: foretold.lean,
            ..sweep.registered(motion, matched, map_restarted)
        }
    }

    fn grow(&mut self, features: &[Feature], motion: &SweepMotion) {
        let moved = self.state.grown_at.is_none_or(|at| {
            (at.translation.vector - motion.mid.translation.vector).norm() > MIN_WAY_M
                || at.rotation.angle_to(&motion.mid.rotation) > MIN_TURN_RAD
        });
        if moved {
            let batch = self.state.next_batch;
            self.maps.insert(batch, features, motion, &self.settings.map);
            self.state.next_batch += 1;
            self.state.grown_at = Some(motion.mid);
        }
    }
}

impl HeldSweep {
    fn registered(&self, motion: SweepMotion, matched: Option<Matched>, map_restarted: bool) -> Registered {
        Registered {
            stamp: self.stamp,
            duration_nanos: self.duration_nanos,
            motion,
            matched,
            map_restarted,
            lean: Lean::default(),
            covariance: Matrix6::zeros(),
            moving: Vec::new(),
        }
    }
}

fn is_plausible(matched: &Matched) -> bool {
    let has_enough = matched.n_matches as f64 >= MIN_MATCHED_SHARE * matched.n_features as f64;
    has_enough && matched.converged && matched.rms_m <= MAX_RMS_M
}

fn is_reachable(mid: &Pose, predicted: &Pose, seconds: f64) -> bool {
    let jump_m = (mid.translation.vector - predicted.translation.vector).norm();
    let jump_rad = mid.rotation.angle_to(&predicted.rotation);
    let square = seconds * seconds;
    jump_m <= JUMP_SLACK_M + MAX_JUMP_MPS2 * square && jump_rad <= JUMP_SLACK_RAD + MAX_JUMP_RADPS2 * square
}
