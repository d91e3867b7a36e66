//! Settings of a simulated drive, and the report about it.

use crate::error::SimulationError;
use crate::limits;
use crate::rig::{CalibrationError, RigSpec};
use crate::sensors::lidar::{LidarErrors, LidarModel};
use crate::sensors::mosaic::EXPOSURE_NANOS;
use messages::ClassId;
use town::{Town, Traffic};

/// Settings of a drive. Equal settings give equal bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveSpec {
    /// Kind of town.
    pub town: Town,
    /// Seed of the town, its traffic and the sensor noise.
    pub seed: u64,
    /// Pass through this town: 0 is the first drive, odd passes drive back in the opposite lane, even ones follow the first. Each
    /// has its own time, traffic and sensor noise.
    pub pass: u64,
    /// Length, s ([`limits::SECONDS`]). The last revolution of the lidar is completed.
    pub seconds: f64,
    /// The lidar fires at every n-th azimuth step; 1 is the real rate, larger values are faster and sparser
    /// ([`limits::LIDAR_STEP`]).
    pub lidar_step: u32,
    /// Whether the color cameras record.
    pub cameras: bool,
    /// Whether the mosaic cameras record.
    pub mosaics: bool,
    /// Exposure of the mosaic cameras and of their dark reference, ns ([`limits::MOSAIC_EXPOSURE_MS`]).
    pub mosaic_exposure_nanos: u64,
    /// Whether `truth/visibility` is written: the returns that are visible in each camera.
    pub truth_visibility: bool,
    /// The vehicle, with nominal mountings.
    pub rig: RigSpec,
    /// Calibration errors of the nominal mountings.
    pub calibration_error: CalibrationError,
    /// Errors of the nominal beams of the lidar.
    pub lidar_errors: LidarErrors,
    /// Density of the traffic.
    pub traffic: Traffic,
}

impl DriveSpec {
    /// An urban drive with all sensors of the default vehicle.
    pub fn urban(seed: u64, seconds: f64) -> Self {
        Self {
            town: Town::Urban,
            seed,
            pass: 0,
            seconds,
            lidar_step: 1,
            cameras: true,
            mosaics: true,
            rig: RigSpec::l3d2(),
            calibration_error: CalibrationError::default(),
            lidar_errors: LidarErrors::NONE,
            traffic: Traffic::Normal,
            mosaic_exposure_nanos: EXPOSURE_NANOS,
            truth_visibility: false,
        }
    }
    /// This drive with only a sparse lidar, for tests.
    #[must_use]
    pub fn sparse(self, lidar_step: u32) -> Self {
        Self { lidar_step, cameras: false, mosaics: false, ..self }
    }
    /// Model of the lidar of the rig.
    pub const fn lidar_model(&self) -> LidarModel {
        LidarModel::for_model(self.rig.lidar.model)
    }
    /// Recorded duration, s: up to the end of the last lidar packet.
    pub fn recorded_seconds(&self) -> f64 {
        let model = self.lidar_model();
        (model.n_packets(self.seconds) as i64 * model.packet_nanos()) as f64 * 1e-9
    }
    pub(crate) fn check(&self) -> Result<(), SimulationError> {
        let CalibrationError { rotation_deg, translation_m } = self.calibration_error;
        limits::SECONDS.check("seconds", self.seconds)?;
        limits::LIDAR_STEP.check("lidar_step", f64::from(self.lidar_step))?;
        limits::CALIBRATION_ERROR_DEG.check("calibration_error_deg", rotation_deg)?;
        limits::CALIBRATION_ERROR_CM.check("calibration_error_cm", translation_m * 100.0)?;
        limits::MOSAIC_EXPOSURE_MS.check("mosaic_exposure_ms", self.mosaic_exposure_nanos as f64 / 1e6)?;
        Ok(())
    }
}

/// Contents of a written drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveReport {
    /// Number of lidar revolutions; the last one ends with its packet.
    pub n_sweeps: u32,
    /// Number of lidar packets.
    pub n_packets: u64,
    /// Number of returns.
    pub n_returns: u64,
    /// Number of color images of all cameras.
    pub n_images: u32,
    /// Number of mosaic images of all cameras, without references.
    pub n_mosaics: u32,
    /// Number of returns by class id.
    pub returns_by_class: [u64; ClassId::ALL.len()],
    /// Number of primitives in the scene.
    pub n_primitives: usize,
}

/// Share of a class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassRate {
    /// The class.
    pub class: ClassId,
    /// Its share of the returns.
    pub share: f64,
}

impl DriveReport {
    /// Classes of the returns with their shares, the most frequent first.
    pub fn class_rates(&self) -> Vec<ClassRate> {
        let total = self.n_returns.max(1) as f64;
        let mut rates: Vec<ClassRate> = ClassId::ALL
            .iter()
            .zip(self.returns_by_class)
            .filter(|(_, n)| *n > 0)
            .map(|(class, n)| ClassRate { class: *class, share: n as f64 / total })
            .collect();
        rates.sort_by(|a, b| b.share.total_cmp(&a.share));
        rates
    }
}
