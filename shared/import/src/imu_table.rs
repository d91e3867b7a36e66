//! IMU samples in third-party tables: a header names the columns.

use crate::error::{At, ImportError};
use crate::stamp_text::{nanos, unquoted};
use drive::imu::ImuSample;
use files::text_file::read_long_text;
use geometry::Stamp;
use std::borrow::Cow;
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
    let text = read_long_text(path).at(path)?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let first = lines.next().map(|(_, line)| line.trim_start_matches('#')).unwrap_or_default();
    let separator = Separator::from_header(first);
    let header = separator.words(first);
    let header: Vec<&str> = header.iter().map(AsRef::as_ref).collect();
    let columns = Columns::from_header(&header).ok_or_else(|| {
        let rule = "the first line must name the columns: timestamp (or sec and nsec), ax ay az (m/s^2 or g) and wx wy wz (rad/s)";
        ImportError::at_line(path, 1, rule)
    })?;
    let mut samples: Vec<ImuSample> = Vec::new();
    for (number, line) in lines {
        let fault = |rule: &str| ImportError::at_line(path, number, format!("{line:?}: {rule}"));
        let words = separator.words(line);
        // Cells of a decimal comma would be read as columns. An empty cell may follow the last column.
        if words.len() > header.len() && words[header.len()..].iter().any(|word| !word.is_empty()) {
            let (n, n_columns) = (words.len(), header.len());
            return Err(fault(&format!(
                "has {n} cells, the first line names {n_columns}; with decimal commas, separate the cells by semicolons or tabs"
            )));
        }
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

/// What separates the cells of a line.
#[derive(Clone, Copy)]
enum Separator {
    Comma,
    /// Semicolons or tabs: a comma is a decimal comma.
    SemicolonOrTab,
    Space,
}

impl Separator {
    fn from_header(header: &str) -> Self {
        match header {
            _ if header.contains([';', '\t']) => Self::SemicolonOrTab,
            _ if header.contains(',') => Self::Comma,
            _ => Self::Space,
        }
    }

    /// The cells of a line, with decimal points.
    fn words(self, line: &str) -> Vec<Cow<'_, str>> {
        let point = |cell: &str| unquoted(cell).replace(',', ".");
        match self {
            Self::Comma => line.split(',').map(unquoted).map(Cow::Borrowed).collect(),
            Self::SemicolonOrTab => line.split([';', '\t']).map(point).map(Cow::Owned).collect(),
            Self::Space => {
                let words: Vec<_> = line.split_whitespace().map(point).map(Cow::Owned).collect();
                // Below a header with spaces, the values may have commas between them.
                if words.len() > 1 { words } else { Self::Comma.words(line) }
            }
        }
    }
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

    fn stamp(&self, words: &[Cow<'_, str>]) -> Option<Stamp> {
        let (first, second) = self.stamp;
        let text = words.get(first)?;
        let Some(second) = second else { return nanos(text).map(Stamp) };
        let seconds: i64 = text.parse().ok()?;
        let nanos: i64 = words.get(second)?.parse().ok()?;
        let is_valid = (0..1_000_000_000).contains(&nanos) && seconds >= 0;
        is_valid.then(|| seconds.checked_mul(1_000_000_000)?.checked_add(nanos)).flatten().map(Stamp)
    }
}
