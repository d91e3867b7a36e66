//! One file per subcommand: its arguments and what it does.

pub mod bench;
pub mod compare;
pub mod convert;
pub mod cube;
pub mod echo;
pub mod evaluate;
pub mod hz;
pub mod import;
pub mod inspect;
pub mod instances;
pub mod record;
pub mod replay;
pub mod send;
pub mod simulate;
pub mod spectrum;
pub mod status;
pub mod stop;
pub mod swap;
pub mod topics;
pub mod train;

use anyhow::Context;
use formats::sensor_calibration::SensorCalibration;
use std::path::Path;

/// The calibration file of a mosaic camera.
pub fn read_sensor(path: &Path) -> anyhow::Result<SensorCalibration> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    SensorCalibration::from_xml(&text).with_context(|| path.display().to_string())
}
