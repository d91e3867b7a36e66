//! A whole drive as a folder (`formats::manifest`).

mod files;
mod lidar_files;
mod manifest;

use crate::error::SimulationError;
use crate::motion::Motion;
use crate::random::{hash, unit};
use crate::rig;
use crate::scene::{self, Scene};
use crate::sensors::camera::ColorCamera;
use crate::sensors::lidar::{Lidar, LidarModel};
use crate::sensors::mosaic::{BIT_DEPTH, MosaicCamera, MosaicModel, SIZE};
use crate::sensors::{gnss, imu, trigger};
use crate::spec::{DriveReport, DriveSpec};
use crate::truth;
use files::Folder;
use formats::pgm::pgm_from_samples;
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
    /// The picture of color camera `index` at a stamp.
    pub fn image(&self, camera: &ColorCamera, index: usize, stamp: Stamp) -> Vec<u8> {
        let seconds = stamp.seconds_since(self.motion.begin);
        let world_from_camera = self.motion.pose(seconds) * rig::color_cameras()[index].1;
        let seed = hash(hash(self.spec.seed, CAMERA_STREAM), stamp.0 as u64 ^ index as u64);
        camera.shoot(&self.scene, &self.scene.at(seconds), &world_from_camera, seed)
    }
    /// The raw samples of mosaic camera `index` at a stamp.
    pub fn mosaic(&self, camera: &MosaicCamera, index: usize, stamp: Stamp) -> Vec<u16> {
        let seconds = stamp.seconds_since(self.motion.begin);
        let world_from_camera = self.motion.pose(seconds) * rig::mosaic_mountings()[index];
        let seed = hash(hash(self.spec.seed, MOSAIC_STREAM), stamp.0 as u64 ^ index as u64);
        camera.shoot(&self.scene, &self.scene.at(seconds), &world_from_camera, seed)
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
        report.n_images = write_images(&simulation, &folder, &exposures, &mut meter)?;
    }
    if spec.mosaics {
        report.n_mosaics = write_mosaics(&simulation, &folder, &exposures, &mut meter)?;
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

fn write_images(
    simulation: &Simulation,
    folder: &Folder,
    exposures: &[Stamp],
    meter: &mut Meter<'_>,
) -> Result<u32, SimulationError> {
    let camera = ColorCamera::new(&rig::color_lens());
    for stamp in exposures {
        for index in 0..rig::N_CAMERAS {
            let pixels = simulation.image(&camera, index, *stamp);
            folder.write_jpeg(&format!("camera/{index}/{}.jpg", stamp.0), &pixels, camera.size())?;
            meter.add(IMAGE_WORK);
        }
    }
    Ok((exposures.len() * rig::N_CAMERAS) as u32)
}

fn write_mosaics(
    simulation: &Simulation,
    folder: &Folder,
    exposures: &[Stamp],
    meter: &mut Meter<'_>,
) -> Result<u32, SimulationError> {
    for (index, model) in mosaic_models().into_iter().enumerate() {
        let name = model.name;
        let camera = MosaicCamera::new(model, &rig::mosaic_lens());
        let write = |path: String, samples: Vec<u16>| {
            folder.write(&path, &pgm_from_samples(SIZE[0] as u32, SIZE[1] as u32, (1 << BIT_DEPTH) - 1, &samples))
        };
        let seed = hash(simulation.spec.seed, MOSAIC_STREAM ^ (index as u64 + 1) << 8);
        write(format!("{name}/dark/0.pgm"), camera.dark(hash(seed, 1)))?;
        write(format!("{name}/white/0.pgm"), camera.white(hash(seed, 2)))?;
        for stamp in exposures {
            write(format!("{name}/{}.pgm", stamp.0), simulation.mosaic(&camera, index, *stamp))?;
            meter.add(MOSAIC_WORK);
        }
    }
    Ok((exposures.len() * 2) as u32)
}

/// Work of a packet, an image and a mosaic in measured ms of one core, for an even progress.
const PACKET_WORK: f64 = 0.6;
/// See [`PACKET_WORK`].
const IMAGE_WORK: f64 = 700.0;
/// See [`PACKET_WORK`].
const MOSAIC_WORK: f64 = 350.0;

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
        let total = packets as f64 * PACKET_WORK + images as f64 * IMAGE_WORK + mosaics as f64 * MOSAIC_WORK;
        Self { done: 0.0, total, tell }
    }
    fn add(&mut self, work: f64) {
        self.done += work;
        (self.tell)((self.done / self.total).min(1.0));
    }
}
