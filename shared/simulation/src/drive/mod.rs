//! A whole drive as a folder (`formats::manifest`).

mod camera_files;
mod files;
mod lidar_files;
mod manifest;
mod visibility;

use crate::error::SimulationError;
use crate::motion::Motion;
use crate::random::{hash, unit};
use crate::rig;
use crate::scene::{self, Scene};
use crate::sensors::camera::ColorCamera;
use crate::sensors::exposure::Exposure;
use crate::sensors::lidar::{Lidar, LidarModel};
use crate::sensors::mosaic::{MosaicCamera, MosaicModel};
use crate::sensors::{gnss, imu, trigger};
use crate::spec::{DriveReport, DriveSpec};
use crate::truth;
use files::Folder;
use geometry::{Pose, Stamp};
use messages::ClassId;
use std::path::Path;

/// 2021-06-01T10:00:00Z; the seed adds up to ten minutes.
const DATE_SECONDS: i64 = 1_622_541_600;

/// Streams of random numbers, one for each sensor.
const LIDAR_STREAM: u64 = 1;
const CAMERA_STREAM: u64 = 2;
const MOSAIC_STREAM: u64 = 3;
const GNSS_STREAM: u64 = 4;
const IMU_STREAM: u64 = 5;

/// The town and the vehicle's way through it, before any sensor.
#[derive(Debug)]
pub struct Simulation {
    /// What it is made from.
    pub spec: DriveSpec,
    /// The town.
    pub scene: Scene,
    /// The vehicle.
    pub motion: Motion,
}

impl Simulation {
    /// Builds the town of a spec.
    pub fn new(spec: &DriveSpec) -> Result<Self, SimulationError> {
        spec.check()?;
        let phase = f64::from(unit(hash(spec.seed, 0))) * std::f64::consts::TAU;
        let scene::Drive { scene, way, pace } = scene::build(spec.town, spec.seed, spec.seconds);
        let begin = Stamp((DATE_SECONDS + (spec.seed % 600) as i64) * 1_000_000_000);
        let motion = Motion::new(begin, way, pace, phase);
        Ok(Self { spec: spec.clone(), scene, motion })
    }
    /// The lidar in it.
    pub fn lidar(&self) -> Lidar<'_> {
        let seed = hash(self.spec.seed, LIDAR_STREAM);
        self.lidar_of(LidarModel::HDL32E, rig::body_from_lidar(), seed)
    }
    /// A lidar of any model, mounted anywhere.
    pub fn lidar_of(&self, model: LidarModel, body_from_lidar: Pose, seed: u64) -> Lidar<'_> {
        Lidar::new(&self.scene, &self.motion, model, body_from_lidar, seed, self.spec.lidar_step)
    }
    /// When the cameras fire.
    pub fn exposures(&self) -> Vec<Stamp> {
        trigger::exposures(&self.motion, self.spec.seconds)
    }
    /// The pictures of all color cameras, which fire together and share their gain, at a stamp.
    pub fn images(&self, camera: &ColorCamera, stamp: Stamp) -> Vec<Vec<u8>> {
        let exposures = self.color_exposures(stamp);
        let gain = camera.meter(&exposures);
        let pictures = exposures.iter().enumerate();
        pictures.map(|(index, exposure)| camera.shoot(exposure, gain, self.image_seed(index, stamp))).collect()
    }
    /// The picture of color camera `index` alone: the same as in [`Self::images`].
    pub fn image(&self, camera: &ColorCamera, index: usize, stamp: Stamp) -> Vec<u8> {
        let exposures = self.color_exposures(stamp);
        camera.shoot(&exposures[index], camera.meter(&exposures), self.image_seed(index, stamp))
    }
    /// The raw samples of mosaic camera `index` at a stamp.
    pub fn mosaic(&self, camera: &MosaicCamera, index: usize, stamp: Stamp) -> Vec<u16> {
        let seed = hash(hash(self.spec.seed, MOSAIC_STREAM), stamp.0 as u64 ^ index as u64);
        let body_from_camera = rig::mosaic_mountings()[index];
        let nanos = camera.exposure_nanos();
        camera.shoot(&Exposure::new(&self.scene, &self.motion, &body_from_camera, stamp, nanos, seed), seed)
    }
    fn color_exposures(&self, stamp: Stamp) -> Vec<Exposure<'_>> {
        let exposure = |(index, (_, body_from_camera)): (usize, (String, Pose))| {
            let (nanos, seed) = (rig::CAMERA_EXPOSURE_NANOS, self.image_seed(index, stamp));
            Exposure::new(&self.scene, &self.motion, &body_from_camera, stamp, nanos, seed)
        };
        rig::color_cameras().into_iter().enumerate().map(exposure).collect()
    }
    fn image_seed(&self, index: usize, stamp: Stamp) -> u64 {
        hash(hash(self.spec.seed, CAMERA_STREAM), stamp.0 as u64 ^ index as u64)
    }
}

/// The mosaic cameras by index.
pub(crate) fn mosaic_models() -> [MosaicModel; 2] {
    [MosaicModel::hs02(), MosaicModel::hs03()]
}

/// Makes the drive in a folder beside `out` and gives it that name when it is complete. `progress` hears the share that is
/// done, 0 to 1.
pub fn write_drive(
    spec: &DriveSpec,
    out: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<DriveReport, SimulationError> {
    spec.check()?;
    if out.exists() {
        return Err(SimulationError::Exists(out.to_owned()));
    }
    let folder = Folder::beside(out)?;
    let simulation = Simulation::new(spec)?;
    let mut report = DriveReport {
        n_sweeps: 0,
        n_packets: 0,
        n_returns: 0,
        n_images: 0,
        n_mosaics: 0,
        returns_by_class: [0; ClassId::ALL.len()],
        n_primitives: simulation.scene.n_primitives(),
    };
    let exposures = simulation.exposures();
    let mut meter = Meter::new(spec, exposures.len(), progress);

    write_pose_sensors(&simulation, &folder)?;
    lidar_files::write(&simulation, &folder, &mut report, &mut |n| meter.add(n as f64 * PACKET_WORK))?;
    if spec.cameras {
        report.n_images = camera_files::write_images(&simulation, &folder, &exposures, &mut meter)?;
    }
    if spec.mosaics {
        report.n_mosaics = camera_files::write_mosaics(&simulation, &folder, &exposures, &mut meter)?;
    }
    camera_files::write_materials(&folder)?;
    if spec.truth_visibility {
        visibility::write(&simulation, &folder, &exposures)?;
    }
    folder.write("drive.toml", toml::to_string(&manifest::manifest(spec))?.as_bytes())?;
    folder.complete(out)?;
    Ok(report)
}

fn write_pose_sensors(simulation: &Simulation, folder: &Folder) -> Result<(), SimulationError> {
    let Simulation { spec, motion, .. } = simulation;
    let (gnss_seed, imu_seed) = (hash(spec.seed, GNSS_STREAM), hash(spec.seed, IMU_STREAM));
    let end = lidar_files::duration_seconds(spec);
    folder.write("gnss.nmea", gnss::nmea(&gnss::record(motion, end, gnss_seed)).as_bytes())?;
    folder.write("imu.csv", formats::imu::csv_from_samples(&imu::record(motion, end, imu_seed)).as_bytes())?;
    let poses = formats::trajectory::tum_from_trajectory(&truth::trajectory(motion, end));
    folder.write("truth/trajectory.txt", poses.as_bytes())
}

/// Work of a packet in measured ms of one core, for an even progress.
const PACKET_WORK: f64 = 0.6;

struct Meter<'a> {
    done: f64,
    total: f64,
    tell: &'a mut dyn FnMut(f64),
}

impl<'a> Meter<'a> {
    fn new(spec: &DriveSpec, n_exposures: usize, tell: &'a mut dyn FnMut(f64)) -> Self {
        let images = if spec.cameras { n_exposures * rig::N_CAMERAS } else { 0 };
        let mosaics = if spec.mosaics { n_exposures * 2 } else { 0 };
        let packets = LidarModel::HDL32E.n_packets(spec.seconds);
        let total = packets as f64 * PACKET_WORK
            + images as f64 * camera_files::IMAGE_WORK
            + mosaics as f64 * camera_files::MOSAIC_WORK;
        Self { done: 0.0, total, tell }
    }
    fn add(&mut self, work: f64) {
        self.done += work;
        (self.tell)((self.done / self.total).min(1.0));
    }
}
