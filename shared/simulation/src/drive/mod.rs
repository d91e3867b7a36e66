//! Writes a simulated drive as a drive folder (`drive::manifest`).

mod camera_files;
mod files;
mod lidar_files;
mod manifest;
mod mark;
mod progress;
mod visibility;

pub use mark::SimulatedDrive;

use crate::error::SimulationError;
use crate::sensors::gnss::{self, Epoch};
use crate::simulation::Simulation;
use crate::spec::{DriveReport, DriveSpec};
use crate::truth;
use files::Folder;
use messages::ClassId;
use progress::{PACKET_WORK, Progress};
use std::path::Path;

/// Simulates a drive and writes it as folder `out`. It is written next to `out` and renamed when complete; a failure
/// leaves no files. `progress` receives the finished share, 0 to 1.
pub fn write_drive(
    spec: &DriveSpec,
    out: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<DriveReport, SimulationError> {
    // Checked before the town is built, which takes several seconds.
    refuse_existing(out)?;
    write_simulation(&Simulation::new(spec)?, out, progress)
}

/// Like [`write_drive`], for an existing simulation.
pub fn write_simulation(
    simulation: &Simulation,
    out: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<DriveReport, SimulationError> {
    refuse_existing(out)?;
    let folder = Folder::next_to(out)?;
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
    let mut progress_meter = Progress::new(simulation, exposures.len(), progress);

    let epochs = simulation.epochs();
    write_pose_sensors(simulation, &folder, &epochs)?;
    lidar_files::write(simulation, &folder, &epochs, &mut report, &mut |n| progress_meter.add(n as f64 * PACKET_WORK))?;
    lidar_files::write_others(simulation, &folder, &mut report, &mut |n| progress_meter.add(n as f64 * PACKET_WORK))?;
    if simulation.spec.cameras {
        report.n_images = camera_files::write_images(simulation, &folder, &exposures, &mut progress_meter)?;
    }
    if simulation.spec.mosaics {
        report.n_mosaics = camera_files::write_mosaics(simulation, &folder, &exposures, &mut progress_meter)?;
    }
    camera_files::write_materials(&folder)?;
    if simulation.spec.truth_visibility {
        visibility::write(simulation, &folder, &exposures)?;
    }
    if let Some(errors) = simulation.spec.lidar_errors.csv(simulation.spec.rig.lidar.model) {
        folder.write(manifest::LIDAR_ERRORS_FILE, errors.as_bytes())?;
    }
    let mark = toml::to_string(&SimulatedDrive::from(&simulation.spec))?;
    folder.write(SimulatedDrive::FILE, mark.as_bytes())?;
    folder.write("drive.toml", toml::to_string(&manifest::manifest(&simulation.spec))?.as_bytes())?;
    folder.complete(out)?;
    Ok(report)
}

fn refuse_existing(out: &Path) -> Result<(), SimulationError> {
    if out.exists() { Err(SimulationError::Exists(out.to_owned())) } else { Ok(()) }
}

fn write_pose_sensors(simulation: &Simulation, folder: &Folder, epochs: &[Epoch]) -> Result<(), SimulationError> {
    let Simulation { spec, motion, rig, .. } = simulation;
    if rig.gnss.is_some() {
        folder.write(manifest::GNSS_FILE, gnss::nmea(epochs).as_bytes())?;
        folder.write(manifest::GNSS_TRUTH_FILE, gnss::truth_csv(epochs).as_bytes())?;
    }
    if let Some(samples) = simulation.imu_samples() {
        folder.write(manifest::IMU_FILE, drive::imu::csv_from_samples(&samples).as_bytes())?;
    }
    let poses = formats::trajectory::tum_from_trajectory(&truth::trajectory(motion, spec.recorded_seconds()));
    folder.write(manifest::TRAJECTORY_FILE, poses.as_bytes())?;
    folder.write(manifest::CALIBRATION_FILE, toml::to_string(&rig.calibration())?.as_bytes())
}
