//! Samples of the IMU: `timestamp gyroX gyroY gyroZ accX accY accZ imuId timestampUnix`, in ns, rad/s and g. Older files have no
//! header.

use crate::error::{At, ImportError};
use crate::files::files;
use crate::imu_units::to_metric;
use drive::imu::ImuSample;
use files::text_file::read_long_text;
use geometry::Stamp;
use std::path::{Path, PathBuf};

/// Columns of files without header.
const COLUMNS: [&str; 8] = ["timestamp", "gyroX", "gyroY", "gyroZ", "accX", "accY", "accZ", "imuId"];

/// Samples of the first IMU of all files.
pub(super) struct ImuLog {
    pub samples: Vec<ImuSample>,
    /// Note about conversion and samples left out, for the report.
    pub note: String,
}

pub(super) fn files_of(source: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let found = files(source, ".csv")?.into_iter().filter(|(name, _)| name.starts_with("imu"));
    Ok(found.map(|(_, path)| path).collect())
}

pub(super) fn read(inputs: &[PathBuf]) -> Result<ImuLog, ImportError> {
    let mut samples: Vec<ImuSample> = Vec::new();
    let mut unit = None;
    let mut n_others = 0;
    let mut n_not_rising = 0;
    for path in inputs {
        let text = read_long_text(path).at(path)?;
        let mut columns: Vec<&str> = COLUMNS.to_vec();
        for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
            let words: Vec<&str> = line.split([' ', ',', '\t']).filter(|word| !word.is_empty()).collect();
            if number == 1 && words.contains(&"gyroX") {
                columns = words;
                continue;
            }
            let word =
                |name: &str| columns.iter().position(|column| *column == name).and_then(|at| words.get(at).copied());
            let fault = |name: &str| {
                let found = word(name).unwrap_or("nothing");
                ImportError::at_line(path, number, format!("{name} is {found:?}; it must be a number"))
            };
            let nanos = word("timestamp").and_then(nanos).ok_or_else(|| fault("timestamp"))?;
            let mut values = [0.0; 6];
            for (value, name) in values.iter_mut().zip(["accX", "accY", "accZ", "gyroX", "gyroY", "gyroZ"]) {
                let number = word(name).and_then(|word| word.parse().ok()).filter(|number: &f64| number.is_finite());
                *value = number.ok_or_else(|| fault(name))?;
            }
            let id = word("imuId").map(str::to_owned);
            if *unit.get_or_insert_with(|| id.clone()) != id {
                n_others += 1;
            } else if samples.last().is_some_and(|last| last.stamp.0 >= nanos) {
                n_not_rising += 1;
            } else {
                let [ax, ay, az, wx, wy, wz] = values;
                samples.push(ImuSample { stamp: Stamp(nanos), acceleration: [ax, ay, az], angular_rate: [wx, wy, wz] });
            }
        }
    }
    let place = inputs.first().map_or(Path::new("imu*.csv"), PathBuf::as_path);
    let mut note = to_metric(&mut samples).map_err(|rule| ImportError::at(place, rule))?.to_owned();
    for (n, what) in [(n_others, "of other units"), (n_not_rising, "whose stamp is not later than the previous one")] {
        if n > 0 {
            note.extend(["; ", &n.to_string(), " ", what, " are left out"]);
        }
    }
    Ok(ImuLog { samples, note })
}

/// Integers are ns, decimals are s.
fn nanos(text: &str) -> Option<i64> {
    if let Ok(nanos) = text.parse() {
        return Some(nanos);
    }
    let seconds: f64 = text.parse().ok().filter(|seconds: &f64| (0.0..9e9).contains(seconds))?;
    Some((seconds * 1e9).round() as i64)
}
