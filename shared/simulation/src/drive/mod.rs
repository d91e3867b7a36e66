//! A whole drive as a folder (`formats::manifest`).

mod files;
mod lidar_files;
mod manifest;

use crate::error::SimulationError;
use crate::motion::{Motion, Progress};
use crate::random::{hash, unit};
use crate::rig::RigSpec;
use crate::scene::{self, Scene};
use crate::sensors::camera::ColorCamera;
use crate::sensors::gnss::{self, Epoch};
use crate::sensors::lidar::{Lidar, LidarModel};
use crate::sensors::mosaic::{BIT_DEPTH, MosaicCamera, SIZE};
use crate::sensors::{imu, trigger};
use crate::spec::{DriveReport, DriveSpec};
use crate::truth;
use files::Folder;
use formats::pgm::pgm_from_samples;
use geometry::{CameraModel, Pose, Stamp};
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
        let progress = Progress { phase: f64::from(unit(hash(spec.seed, 0))) * std::f64::consts::TAU };
        let scene = scene::build(spec.seed, spec.seconds, progress);
        let begin = Stamp((DATE_SECONDS + (spec.seed % 600) as i64) * 1_000_000_000);
        let motion =
            Motion::new(begin, progress, scene.street.clone(), scene::LANE_T).with_body_height(spec.rig.body_height_m);
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
    /// The picture of color camera `index` at a stamp.
    pub fn image(&self, camera: &ColorCamera, index: usize, stamp: Stamp) -> Vec<u8> {
        let seconds = stamp.seconds_since(self.motion.begin);
        let world_from_camera = self.motion.pose(seconds) * self.rig.cameras[index].body_from_camera;
        let seed = hash(hash(self.spec.seed, CAMERA_STREAM), stamp.0 as u64 ^ index as u64);
        camera.shoot(&self.scene, &self.scene.at(seconds), &world_from_camera, seed)
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
        let seconds = stamp.seconds_since(self.motion.begin);
        let world_from_camera = self.motion.pose(seconds) * self.rig.mosaics[index].body_from_camera;
        let seed = hash(hash(self.spec.seed, MOSAIC_STREAM), stamp.0 as u64 ^ index as u64);
        camera.shoot(&self.scene, &self.scene.at(seconds), &world_from_camera, seed)
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
        report.n_images = write_images(simulation, &folder, &exposures, &mut meter)?;
    }
    if simulation.spec.mosaics {
        report.n_mosaics = write_mosaics(simulation, &folder, &exposures, &mut meter)?;
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

fn write_images(
    simulation: &Simulation,
    folder: &Folder,
    exposures: &[Stamp],
    meter: &mut Meter<'_>,
) -> Result<u32, SimulationError> {
    for (index, camera) in simulation.rig.cameras.iter().enumerate() {
        let eye = ColorCamera::new(&camera.lens);
        for stamp in exposures {
            let pixels = simulation.image(&eye, index, *stamp);
            folder.write_jpeg(&format!("camera/{index}/{}.jpg", stamp.0), &pixels, eye.size())?;
            meter.add(image_work(&camera.lens));
        }
    }
    Ok((exposures.len() * simulation.rig.cameras.len()) as u32)
}

fn write_mosaics(
    simulation: &Simulation,
    folder: &Folder,
    exposures: &[Stamp],
    meter: &mut Meter<'_>,
) -> Result<u32, SimulationError> {
    for (index, mosaic) in simulation.rig.mosaics.iter().enumerate() {
        let name = &mosaic.name;
        let camera = MosaicCamera::new(mosaic.sensor.clone(), &mosaic.lens);
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
    Ok((exposures.len() * simulation.rig.mosaics.len()) as u32)
}

/// Work of a packet, a pixel of an image and a mosaic in measured ms of one core, for an even progress.
const PACKET_WORK: f64 = 0.6;
/// See [`PACKET_WORK`].
const PIXEL_WORK: f64 = 2.2e-3;
/// See [`PACKET_WORK`].
const MOSAIC_WORK: f64 = 350.0;

fn image_work(lens: &CameraModel) -> f64 {
    let (width, height) = lens.size();
    f64::from(width) * f64::from(height) * PIXEL_WORK
}

struct Meter<'a> {
    done: f64,
    total: f64,
    tell: &'a mut dyn FnMut(f64),
}

impl<'a> Meter<'a> {
    fn new(simulation: &Simulation, n_exposures: usize, tell: &'a mut dyn FnMut(f64)) -> Self {
        let Simulation { spec, rig, .. } = simulation;
        let packets = spec.lidar_model().n_packets(spec.seconds) as f64 * PACKET_WORK;
        let images: f64 = rig.cameras.iter().map(|camera| image_work(&camera.lens)).sum();
        let mosaics = rig.mosaics.len() as f64 * MOSAIC_WORK;
        let exposure = if spec.cameras { images } else { 0.0 } + if spec.mosaics { mosaics } else { 0.0 };
        Self { done: 0.0, total: packets + n_exposures as f64 * exposure, tell }
    }
    fn add(&mut self, work: f64) {
        self.done += work;
        (self.tell)((self.done / self.total).min(1.0));
    }
}
