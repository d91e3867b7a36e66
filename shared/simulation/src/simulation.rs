//! The simulated world: the town, the motion of the ego vehicle, and the rig with its true mountings.

use crate::error::SimulationError;
use crate::motion::Motion;
use crate::rig::{LidarSpec, RigSpec};
use crate::sensors::camera::ColorCamera;
use crate::sensors::exposure::Exposure;
use crate::sensors::gnss::{self, Epoch};
use crate::sensors::imu;
use crate::sensors::lidar::{Lidar, LidarErrors, LidarModel, Pattern, PatternLidar};
use crate::sensors::mosaic::MosaicCamera;
use crate::sensors::trigger;
use crate::spec::DriveSpec;
use drive::imu::ImuSample;
use geometry::{Pose, Stamp};
use random::{hash, unit};
use town::Scene;

/// 2021-06-01T10:00:00Z; the seed adds up to ten minutes.
const DATE_SECONDS: i64 = 1_622_541_600;

/// Time from the start of a pass to the next one, s, and the number of passes of a day.
const PASS_SECONDS: i64 = 1800;
const PASSES: u64 = 48;

/// Streams of random numbers, one for each sensor.
const LIDAR_STREAM: u64 = 1;
const CAMERA_STREAM: u64 = 2;
pub(crate) const MOSAIC_STREAM: u64 = 3;
const GNSS_STREAM: u64 = 4;
const IMU_STREAM: u64 = 5;
const CALIBRATION_STREAM: u64 = 6;

/// A simulated world: the town, the motion of the ego vehicle, and its rig.
#[derive(Debug)]
pub struct Simulation {
    /// The settings of the simulation.
    pub spec: DriveSpec,
    /// The town.
    pub scene: Scene,
    /// Motion of the ego vehicle.
    pub motion: Motion,
    /// The rig with its true mountings; the spec has the nominal ones.
    pub rig: RigSpec,
}

impl Simulation {
    /// Builds the town of a spec.
    pub fn new(spec: &DriveSpec) -> Result<Self, SimulationError> {
        spec.check()?;
        let phase = f64::from(unit(hash(spec.seed, 0))) * std::f64::consts::TAU;
        let town::Drive { scene, path, speed } =
            town::build(spec.town, spec.seed, spec.seconds, spec.traffic, spec.pass);
        let pass_seconds = (spec.pass % PASSES) as i64 * PASS_SECONDS;
        let begin = Stamp((DATE_SECONDS + (spec.seed % 600) as i64 + pass_seconds) * 1_000_000_000);
        let motion = Motion::new(begin, path, speed, phase)
            .with_cruise(spec.town.cruise_mps())
            .with_body_height(spec.rig.body_height_m);
        let rig = spec.rig.with_true_mountings(spec.calibration_error, hash(spec.seed, CALIBRATION_STREAM));
        Ok(Self { spec: spec.clone(), scene, motion, rig })
    }
    /// An additional lidar of the rig, with the parameters of its unit.
    pub fn other_lidar(&self, index: usize, spec: &LidarSpec) -> Lidar<'_> {
        let number = index as u64 + 1;
        let errors = &self.spec.lidar_errors;
        let errors = LidarErrors { unit_seed: errors.unit_seed.wrapping_add(number), ..*errors };
        let seed = hash(self.seed_of(LIDAR_STREAM), number);
        let model = LidarModel::for_model(spec.model);
        let step = self.spec.lidar_step;
        Lidar::new(&self.scene, &self.motion, model, &errors, spec.body_from_lidar, seed, step)
    }
    /// The first lidar of the rig.
    pub fn lidar(&self) -> Lidar<'_> {
        let seed = self.seed_of(LIDAR_STREAM);
        self.lidar_of(self.spec.lidar_model(), self.rig.lidar.body_from_lidar, seed)
    }
    /// A lidar of any model at any mounting, with the errors of the spec.
    pub fn lidar_of(&self, model: LidarModel, body_from_lidar: Pose, seed: u64) -> Lidar<'_> {
        self.lidar_unit(model, &self.spec.lidar_errors, body_from_lidar, seed)
    }
    /// A lidar of any model at any mounting, with its own errors.
    pub fn lidar_unit(&self, model: LidarModel, errors: &LidarErrors, body_from_lidar: Pose, seed: u64) -> Lidar<'_> {
        Lidar::new(&self.scene, &self.motion, model, errors, body_from_lidar, seed, self.spec.lidar_step)
    }
    /// A perfect lidar with a pattern that is not a Velodyne pattern.
    pub fn pattern_lidar(&self, pattern: Pattern, body_from_lidar: Pose, seed: u64) -> PatternLidar<'_> {
        PatternLidar::new(&self.scene, &self.motion, pattern, body_from_lidar, seed)
    }
    /// Stamps of the exposures.
    pub fn exposures(&self) -> Vec<Stamp> {
        trigger::exposures(&self.motion, &self.rig.trigger, self.spec.seconds)
    }
    /// Images of the color cameras `group` (indices) at a stamp. They fire together and share their gain.
    pub fn images(&self, camera: &ColorCamera, group: &[usize], stamp: Stamp) -> Vec<Vec<u8>> {
        let exposures: Vec<Exposure<'_>> = group.iter().map(|index| self.color_exposure(*index, stamp)).collect();
        let gain = camera.meter(&exposures);
        let members = exposures.iter().zip(group);
        members.map(|(exposure, index)| camera.shoot(exposure, gain, self.image_seed(*index, stamp))).collect()
    }
    /// Image of one color camera, identical to the image from [`Self::images`].
    pub fn image(&self, camera: &ColorCamera, index: usize, stamp: Stamp) -> Vec<u8> {
        let group = self.rig.lens_groups().into_iter().find(|group| group.contains(&index)).unwrap_or_default();
        let exposures: Vec<Exposure<'_>> = group.iter().map(|index| self.color_exposure(*index, stamp)).collect();
        let gain = camera.meter(&exposures);
        camera.shoot(&self.color_exposure(index, stamp), gain, self.image_seed(index, stamp))
    }
    /// Output of the GNSS receiver, one epoch per second; empty without a receiver.
    pub fn epochs(&self) -> Vec<Epoch> {
        let seed = self.seed_of(GNSS_STREAM);
        let end = self.spec.recorded_seconds();
        let record = |gnss| gnss::record(&self.scene, &self.motion, gnss, end, seed);
        self.rig.gnss.as_ref().map(record).unwrap_or_default()
    }
    /// Samples of the inertial unit; `None` without a unit.
    pub fn imu_samples(&self) -> Option<Vec<ImuSample>> {
        let imu = self.rig.imu.as_ref()?;
        Some(imu::record(&self.motion, imu, self.spec.recorded_seconds(), self.seed_of(IMU_STREAM)))
    }
    /// Raw samples of mosaic camera `index` at a stamp.
    pub fn mosaic(&self, camera: &MosaicCamera, index: usize, stamp: Stamp) -> Vec<u16> {
        let seed = hash(self.seed_of(MOSAIC_STREAM), stamp.0 as u64 ^ index as u64);
        let body_from_camera = self.rig.mosaics[index].body_from_camera;
        let nanos = camera.exposure_nanos();
        camera.shoot(&Exposure::new(&self.scene, &self.motion, &body_from_camera, stamp, nanos, seed), seed)
    }
    /// Exposure of one color camera at a stamp.
    pub fn color_exposure(&self, index: usize, stamp: Stamp) -> Exposure<'_> {
        let camera = &self.rig.cameras[index];
        let seed = self.image_seed(index, stamp);
        Exposure::new(&self.scene, &self.motion, &camera.body_from_camera, stamp, camera.exposure_nanos, seed)
    }
    /// Seed of the noise of a sensor: another one in each pass.
    fn seed_of(&self, stream: u64) -> u64 {
        let DriveSpec { seed, pass, .. } = self.spec;
        hash(if pass == 0 { seed } else { hash(seed, pass) }, stream)
    }
    fn image_seed(&self, index: usize, stamp: Stamp) -> u64 {
        hash(self.seed_of(CAMERA_STREAM), stamp.0 as u64 ^ index as u64)
    }
}
