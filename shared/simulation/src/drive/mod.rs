//! A whole drive as a folder (`formats::manifest`).

mod camera_files;
mod files;
mod lidar_files;
mod manifest;
mod visibility;

use crate::error::SimulationError;
use crate::motion::Motion;
use crate::random::{hash, unit};
use crate::rig::RigSpec;
use crate::scene::{self, Scene};
use crate::sensors::camera::ColorCamera;
use crate::sensors::exposure::Exposure;
use crate::sensors::gnss::{self, Epoch};
use crate::sensors::lidar::{Lidar, LidarModel};
use crate::sensors::mosaic::MosaicCamera;
use crate::sensors::{imu, trigger};
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
const CALIBRATION_STREAM: u64 = 6;

/// The town and the vehicle's way through it, before any sensor.
#[derive(Debug)]
pub struct Simulation {
    /// What it is made from.
    pub spec: DriveSpec,
    /// The town.
    pub scene: Scene,
    /// The vehicle's way.
    pub motion: Motion,
    /// The vehicle as it really is; that of the spec is what its maker measured.
    pub rig: RigSpec,
}

impl Simulation {
    /// Builds the town of a spec.
    pub fn new(spec: &DriveSpec) -> Result<Self, SimulationError> {
        spec.check()?;
        let phase = f64::from(unit(hash(spec.seed, 0))) * std::f64::consts::TAU;
        let scene::Drive { scene, way, pace } = scene::build(spec.town, spec.seed, spec.seconds);
        let begin = Stamp((DATE_SECONDS + (spec.seed % 600) as i64) * 1_000_000_000);
        let motion = Motion::new(begin, way, pace, phase).with_body_height(spec.rig.body_height_m);
        let rig = spec.rig.with_true_mountings(spec.calibration_error, hash(spec.seed, CALIBRATION_STREAM));
        Ok(Self { spec: spec.clone(), scene, motion, rig })
    }
    /// The lidar in it.
    pub fn lidar(&self) -> Lidar<'_> {
        let seed = hash(self.spec.seed, LIDAR_STREAM);
        self.lidar_of(self.spec.lidar_model(), self.rig.lidar.body_from_lidar, seed)
    }
    /// A lidar of any model, mounted anywhere.
    pub fn lidar_of(&self, model: LidarModel, body_from_lidar: Pose, seed: u64) -> Lidar<'_> {
        Lidar::new(&self.scene, &self.motion, model, body_from_lidar, seed, self.spec.lidar_step)
    }
    /// When the cameras fire.
    pub fn exposures(&self) -> Vec<Stamp> {
        trigger::exposures(&self.motion, &self.rig.trigger, self.spec.seconds)
    }
    /// The pictures of the color cameras `group` (indexes), which fire together and share their gain, at a stamp.
    pub fn images(&self, camera: &ColorCamera, group: &[usize], stamp: Stamp) -> Vec<Vec<u8>> {
        let exposures: Vec<Exposure<'_>> = group.iter().map(|index| self.color_exposure(*index, stamp)).collect();
        let gain = camera.meter(&exposures);
        let pictures = exposures.iter().zip(group);
        pictures.map(|(exposure, index)| camera.shoot(exposure, gain, self.image_seed(*index, stamp))).collect()
    }
    /// The picture of color camera `index` alone: the same as in [`Self::images`].
    pub fn image(&self, camera: &ColorCamera, index: usize, stamp: Stamp) -> Vec<u8> {
        let group = self.rig.lens_groups().into_iter().find(|group| group.contains(&index)).unwrap_or_default();
        let exposures: Vec<Exposure<'_>> = group.iter().map(|index| self.color_exposure(*index, stamp)).collect();
        let gain = camera.meter(&exposures);
        camera.shoot(&self.color_exposure(index, stamp), gain, self.image_seed(index, stamp))
    }
    /// What the receiver says in every second; nothing if the vehicle has none.
    pub fn epochs(&self) -> Vec<Epoch> {
        let seed = hash(self.spec.seed, GNSS_STREAM);
        let end = lidar_files::duration_seconds(&self.spec);
        let record = |gnss| gnss::record(&self.scene, &self.motion, gnss, end, seed);
        self.rig.gnss.as_ref().map(record).unwrap_or_default()
    }
    /// The raw samples of mosaic camera `index` at a stamp.
    pub fn mosaic(&self, camera: &MosaicCamera, index: usize, stamp: Stamp) -> Vec<u16> {
        let seed = hash(hash(self.spec.seed, MOSAIC_STREAM), stamp.0 as u64 ^ index as u64);
        let body_from_camera = self.rig.mosaics[index].body_from_camera;
        let nanos = camera.exposure_nanos();
        camera.shoot(&Exposure::new(&self.scene, &self.motion, &body_from_camera, stamp, nanos, seed), seed)
    }
    fn color_exposure(&self, index: usize, stamp: Stamp) -> Exposure<'_> {
        let camera = &self.rig.cameras[index];
        let seed = self.image_seed(index, stamp);
        Exposure::new(&self.scene, &self.motion, &camera.body_from_camera, stamp, camera.exposure_nanos, seed)
    }
    fn image_seed(&self, index: usize, stamp: Stamp) -> u64 {
        hash(hash(self.spec.seed, CAMERA_STREAM), stamp.0 as u64 ^ index as u64)
    }
}

/// Makes the drive in a folder beside `out` and gives it that name when it is complete; a failure leaves nothing. `progress`
/// hears the share that is done, 0 to 1.
pub fn write_drive(
    spec: &DriveSpec,
    out: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<DriveReport, SimulationError> {
    // Before the town is built, which takes a while.
    refuse_existing(out)?;
    write_simulation(&Simulation::new(spec)?, out, progress)
}

/// Like [`write_drive`], of a town that is there.
pub fn write_simulation(
    simulation: &Simulation,
    out: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<DriveReport, SimulationError> {
    refuse_existing(out)?;
    let folder = Folder::beside(out)?;
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
    let mut meter = Meter::new(simulation, exposures.len(), progress);

    let epochs = simulation.epochs();
    write_pose_sensors(simulation, &folder, &epochs)?;
    lidar_files::write(simulation, &folder, &epochs, &mut report, &mut |n| meter.add(n as f64 * PACKET_WORK))?;
    if simulation.spec.cameras {
        report.n_images = camera_files::write_images(simulation, &folder, &exposures, &mut meter)?;
    }
    if simulation.spec.mosaics {
        report.n_mosaics = camera_files::write_mosaics(simulation, &folder, &exposures, &mut meter)?;
    }
    camera_files::write_materials(&folder)?;
    if simulation.spec.truth_visibility {
        visibility::write(simulation, &folder, &exposures)?;
    }
    folder.write("drive.toml", toml::to_string(&manifest::manifest(&simulation.spec))?.as_bytes())?;
    folder.complete(out)?;
    Ok(report)
}

fn refuse_existing(out: &Path) -> Result<(), SimulationError> {
    if out.exists() { Err(SimulationError::Exists(out.to_owned())) } else { Ok(()) }
}

fn write_pose_sensors(simulation: &Simulation, folder: &Folder, epochs: &[Epoch]) -> Result<(), SimulationError> {
    let Simulation { spec, motion, rig, .. } = simulation;
    let end = lidar_files::duration_seconds(spec);
    if rig.gnss.is_some() {
        folder.write(manifest::GNSS_FILE, gnss::nmea(epochs).as_bytes())?;
        folder.write(manifest::GNSS_TRUTH_FILE, gnss::truth_csv(epochs).as_bytes())?;
    }
    if let Some(imu) = &rig.imu {
        let samples = imu::record(motion, imu, end, hash(spec.seed, IMU_STREAM));
        folder.write(manifest::IMU_FILE, formats::imu::csv_from_samples(&samples).as_bytes())?;
    }
    let poses = formats::trajectory::tum_from_trajectory(&truth::trajectory(motion, end));
    folder.write(manifest::TRAJECTORY_FILE, poses.as_bytes())?;
    folder.write(manifest::CALIBRATION_FILE, toml::to_string(&rig.calibration())?.as_bytes())
}

/// Work of a packet in measured ms of one core, for an even progress.
const PACKET_WORK: f64 = 0.6;

struct Meter<'a> {
    done: f64,
    total: f64,
    tell: &'a mut dyn FnMut(f64),
}

impl<'a> Meter<'a> {
    fn new(simulation: &Simulation, n_exposures: usize, tell: &'a mut dyn FnMut(f64)) -> Self {
        let Simulation { spec, rig, .. } = simulation;
        let packets = spec.lidar_model().n_packets(spec.seconds) as f64 * PACKET_WORK;
        let images: f64 = rig.cameras.iter().map(|camera| camera_files::image_work(&camera.lens)).sum();
        let mosaics = rig.mosaics.len() as f64 * camera_files::MOSAIC_WORK;
        let exposure = if spec.cameras { images } else { 0.0 } + if spec.mosaics { mosaics } else { 0.0 };
        Self { done: 0.0, total: packets + n_exposures as f64 * exposure, tell }
    }
    fn add(&mut self, work: f64) {
        self.done += work;
        (self.tell)((self.done / self.total).min(1.0));
    }
}
