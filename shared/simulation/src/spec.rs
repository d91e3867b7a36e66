//! What drive to make.

use crate::error::SimulationError;
use crate::rig::{CalibrationError, RigSpec};
use crate::sensors::lidar::LidarModel;
use crate::sensors::mosaic::EXPOSURE_NANOS;
use messages::ClassId;

/// The kind of town.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Town {
    /// Blocks of houses, squares and parks; crossings with lights.
    Urban,
    /// Houses in gardens along curved roads.
    Suburban,
    /// A country road: village, fields, forest, tunnel, level crossing, canal, farms.
    Rural,
    /// The same road between open fields: nothing stands near it but at its village.
    Field,
    /// The same road through tunnels; the drive begins before the first one.
    Tunnel,
}

impl Town {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Urban, Self::Suburban, Self::Rural, Self::Field, Self::Tunnel];

    /// As it is called on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Urban => "urban",
            Self::Suburban => "suburban",
            Self::Rural => "rural",
            Self::Field => "field",
            Self::Tunnel => "tunnel",
        }
    }
}

/// A drive by its seed. Equal specs give equal bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveSpec {
    /// Where.
    pub town: Town,
    /// Of everything random: the town, its traffic, the noise of the sensors.
    pub seed: u64,
    /// Length, s: 0.2 to 2400. The last revolution of the lidar is completed.
    pub seconds: f64,
    /// The lidar fires at every n-th azimuth step; 1 is the real rate, more is faster and sparser. 1 to 100.
    pub lidar_step: u32,
    /// Whether the color cameras record.
    pub cameras: bool,
    /// Whether the mosaic cameras record.
    pub mosaics: bool,
    /// Exposure of the mosaic cameras and of their dark reference, ns: 0.1 to 1000 ms.
    pub mosaic_exposure_nanos: u64,
    /// Whether `truth/visibility` is written: which returns each camera sees.
    pub truth_visibility: bool,
    /// The vehicle, as its maker measured it.
    pub rig: RigSpec,
    /// How far the true mountings are from those.
    pub calibration_error: CalibrationError,
}

impl DriveSpec {
    /// An urban drive with all sensors of the thesis' vehicle.
    pub fn urban(seed: u64, seconds: f64) -> Self {
        Self {
            town: Town::Urban,
            seed,
            seconds,
            lidar_step: 1,
            cameras: true,
            mosaics: true,
            rig: RigSpec::l3d2(),
            calibration_error: CalibrationError::default(),
            mosaic_exposure_nanos: EXPOSURE_NANOS,
            truth_visibility: false,
        }
    }
    /// The same drive with a sparse lidar alone, for tests.
    #[must_use]
    pub fn sparse(self, lidar_step: u32) -> Self {
        Self { lidar_step, cameras: false, mosaics: false, ..self }
    }
    /// What the rig's lidar can do.
    pub const fn lidar_model(&self) -> LidarModel {
        LidarModel::of(self.rig.lidar.model)
    }
    pub(crate) fn check(&self) -> Result<(), SimulationError> {
        let bad = |name, value: String, rule| Err(SimulationError::Setting { name, value, rule });
        // Forty minutes are 14 km of streets and 30 GB of drive with all cameras, 5 GB without.
        if !(0.2..=2400.0).contains(&self.seconds) {
            return bad("seconds", self.seconds.to_string(), "must be 0.2 to 2400");
        }
        if !(1..=100).contains(&self.lidar_step) {
            return bad("lidar_step", self.lidar_step.to_string(), "must be 1 to 100");
        }
        let CalibrationError { rotation_deg, translation_m } = self.calibration_error;
        if !(0.0..=10.0).contains(&rotation_deg) {
            return bad("calibration_error.rotation_deg", rotation_deg.to_string(), "must be 0 to 10");
        }
        if !(0.0..=1.0).contains(&translation_m) {
            return bad("calibration_error.translation_m", translation_m.to_string(), "must be 0 to 1");
        }
        if !(100_000..=1_000_000_000).contains(&self.mosaic_exposure_nanos) {
            let value = self.mosaic_exposure_nanos.to_string();
            return bad("mosaic_exposure_nanos", value, "must be 100000 to 1000000000");
        }
        Ok(())
    }
}

/// What the drive holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveReport {
    /// Revolutions of the lidar, the last one cut short by the end of its packet.
    pub n_sweeps: u32,
    /// Lidar packets.
    pub n_packets: u64,
    /// Returns.
    pub n_returns: u64,
    /// Color images, of all cameras.
    pub n_images: u32,
    /// Mosaic images, of both cameras, references aside.
    pub n_mosaics: u32,
    /// Returns by class id.
    pub returns_by_class: [u64; ClassId::ALL.len()],
    /// Primitives in the scene.
    pub n_primitives: usize,
}

impl DriveReport {
    /// Classes that were seen, with their share of the returns, the most frequent first.
    pub fn class_rates(&self) -> Vec<(ClassId, f64)> {
        let total = self.n_returns.max(1) as f64;
        let mut rates: Vec<(ClassId, f64)> = ClassId::ALL
            .iter()
            .zip(self.returns_by_class)
            .filter(|(_, n)| *n > 0)
            .map(|(class, n)| (*class, n as f64 / total))
            .collect();
        rates.sort_by(|a, b| b.1.total_cmp(&a.1));
        rates
    }
}
