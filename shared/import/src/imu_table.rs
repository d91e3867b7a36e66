//! IMU samples in third-party tables: a header names the columns.

use crate::error::{At, ImportError};
use crate::stamp_text::nanos;
use drive::imu::ImuSample;
use geometry::Stamp;
use std::fs;
use std::path::Path;

/// Prefixes of the names of a stamp column, in lower case, reduced to letters and digits.
const STAMPS: [&str; 5] = ["timestamp", "stamp", "time", "t", "gpstime"];
/// Names of the columns of accelerations and of rates, without their axis.
const ACCELERATIONS: [&str; 6] = ["a", "acc", "accel", "linearacceleration", "arss", "acceleration"];
const RATES: [&str; 7] = ["w", "gyro", "gyr", "angularvelocity", "wrss", "omega", "angvel"];

/// Places of the columns.
struct Columns {
    /// One stamp, or seconds and ns in two columns.
    stamp: (usize, Option<usize>),
    values: [usize; 6],
}

/// Reads a table, in its own units.
pub(crate) fn read(path: &Path) -> Result<Vec<ImuSample>, ImportError> {
    let text = fs::read_to_string(path).at(path)?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let header = lines.next().map(|(_, line)| words(line.trim_start_matches('#'))).unwrap_or_default();
    let columns = Columns::from_header(&header).ok_or_else(|| {
        let rule = "the first line must name the columns: timestamp (or sec and nsec), ax ay az (m/s^2 or g) and wx wy wz (rad/s)";
        ImportError::at_line(path, 1, rule)
    })?;
    let mut samples: Vec<ImuSample> = Vec::new();
    for (number, line) in lines {
        let fault = |rule: &str| ImportError::at_line(path, number, format!("{line:?}: {rule}"));
        let words = words(line);
        let stamp = columns.stamp(&words).ok_or_else(|| fault("has no valid stamp"))?;
        let value = |column: usize| words.get(column)?.parse().ok().filter(|value: &f64| value.is_finite());
        let Some([ax, ay, az, wx, wy, wz]) = all(columns.values.map(value)) else {
            return Err(fault("must have finite numbers in its six columns"));
        };
        if samples.last().is_some_and(|last| last.stamp >= stamp) {
            return Err(fault("the stamp must be later than in the previous line"));
        }
        samples.push(ImuSample { stamp, acceleration: [ax, ay, az], angular_rate: [wx, wy, wz] });
    }
    Ok(samples)
}

/// The values, if none is missing.
fn all(values: [Option<f64>; 6]) -> Option<[f64; 6]> {
    values.iter().copied().collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// Fields of a line.
fn words(line: &str) -> Vec<&str> {
    let by_comma: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
    if by_comma.len() > 1 { by_comma } else { line.split_whitespace().collect() }
}

impl Columns {
    fn from_header(header: &[&str]) -> Option<Self> {
        // Units are in brackets.
        let name = |word: &&str| -> String {
            let word = word.split(['[', '(']).next().unwrap_or_default().to_lowercase();
            word.chars().filter(char::is_ascii_alphanumeric).collect()
        };
        let names: Vec<String> = header.iter().map(name).collect();
        let find = |wanted: &str| names.iter().position(|name| name == wanted);
        let stamp = match (find("sec"), find("nsec")) {
            (Some(seconds), nanos @ Some(_)) => (seconds, nanos),
            _ => (STAMPS.iter().find_map(|wanted| find(wanted))?, None),
        };
        let axes = |groups: &[&str]| -> Option<[usize; 3]> {
            let columns = |group: &&str| {
                Some([find(&format!("{group}x"))?, find(&format!("{group}y"))?, find(&format!("{group}z"))?])
            };
            groups.iter().find_map(columns)
        };
        let [ax, ay, az] = axes(&ACCELERATIONS)?;
        let [wx, wy, wz] = axes(&RATES)?;
        Some(Self { stamp, values: [ax, ay, az, wx, wy, wz] })
    }

    fn stamp(&self, words: &[&str]) -> Option<Stamp> {
        let (first, second) = self.stamp;
        let text = words.get(first)?;
        let Some(second) = second else { return nanos(text).map(Stamp) };
        let seconds: i64 = text.parse().ok()?;
        let nanos: i64 = words.get(second)?.parse().ok()?;
        let is_valid = (0..1_000_000_000).contains(&nanos) && seconds >= 0;
        is_valid.then(|| seconds.checked_mul(1_000_000_000)?.checked_add(nanos)).flatten().map(Stamp)
    }
}
