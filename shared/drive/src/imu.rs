//! IMU samples as CSV with the header `stamp,ax,ay,az,wx,wy,wz`: ns since the Unix epoch, m/s^2, rad/s, along the body axes.

use geometry::{Stamp, UnitQuaternion, Vector3};
use std::fmt::Write;
use std::io::{self, BufRead, Read};

/// First line of a file.
pub const HEADER: &str = "stamp,ax,ay,az,wx,wy,wz";
/// Columns of [`HEADER`].
const N_COLUMNS: usize = 7;
/// Longest line that is read, bytes. Seven numbers need less than 200.
const MAX_LINE: u64 = 1024;

/// Largest acceleration, m/s^2: one hundred times gravity. Vehicle sensors saturate far below, so a larger value is damage.
pub const MAX_ACCELERATION: f64 = 1000.0;
/// Largest angular rate, rad/s: sixteen turns per second.
pub const MAX_ANGULAR_RATE: f64 = 100.0;

/// One sample in the body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Time of the measurement.
    pub stamp: Stamp,
    /// Specific force, m/s^2; about (0, 0, 9.81) at rest.
    pub acceleration: [f64; 3],
    /// Angular rate, rad/s.
    pub angular_rate: [f64; 3],
}

/// Error of a sample that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ImuError {
    /// A line is invalid. Reading continues with the next line.
    #[error("line {line}: {fault}")]
    Line {
        /// Counted from 1.
        line: u64,
        /// Fault of the line.
        fault: ImuFault,
    },
    /// The operating system reported an error. Reading stops.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Fault of a line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImuFault {
    /// It is not UTF-8.
    #[error("the line is not text")]
    NotText,
    /// The stamp is not an integer.
    #[error("stamp {0:?} is not an integer number of ns")]
    Stamp(String),
    /// A column is missing.
    #[error("{0} is missing; expected columns {HEADER}")]
    MissingColumn(&'static str),
    /// There are more cells than columns, as with decimal commas.
    #[error("{n} cells for {n_columns} columns {HEADER}; numbers must have a decimal point")]
    ManyCells {
        /// Cells of the line.
        n: usize,
        /// Columns of the header.
        n_columns: usize,
    },
    /// A column is not a finite number.
    #[error("{column} {found:?} is not a finite number")]
    Number {
        /// Name of the column.
        column: &'static str,
        /// Text found.
        found: String,
    },
    /// A column has a value that no vehicle reaches.
    #[error("{column} {found} must be {} to {limit} {unit}", -limit)]
    Impossible {
        /// Name of the column.
        column: &'static str,
        /// Text found.
        found: String,
        /// Largest absolute value.
        limit: f64,
        /// Unit of the value.
        unit: &'static str,
    },
    /// The stamp is not after the previous one.
    #[error("stamp {stamp} is not after the previous stamp {previous}")]
    NotRising {
        /// Stamp of this line.
        stamp: Stamp,
        /// Stamp of the last valid line.
        previous: Stamp,
    },
}

/// Parses a log line by line.
#[derive(Debug, Default)]
pub struct ImuParser {
    line: u64,
    last: Option<Stamp>,
    /// Columns that the header names in addition to the seven.
    n_more_columns: usize,
    body_from_unit: Option<UnitQuaternion<f64>>,
    delay_nanos: i64,
}

impl ImuParser {
    /// Returns the parser for a unit with other axes than the body: samples are rotated into the body frame.
    #[must_use]
    pub fn rotated(self, body_from_unit: UnitQuaternion<f64>) -> Self {
        Self { body_from_unit: Some(body_from_unit), ..self }
    }

    /// Returns the parser for a unit whose stamps are late: samples get the time of the measurement.
    #[must_use]
    pub fn delayed(self, delay_nanos: i64) -> Self {
        Self { delay_nanos, ..self }
    }

    /// The sample of the next line; `None` for an empty line and for the header in the first line.
    pub fn take(&mut self, line: &[u8]) -> Option<Result<ImuSample, ImuError>> {
        self.line += 1;
        let line = line.strip_prefix(b"\xef\xbb\xbf").filter(|_| self.line == 1).unwrap_or(line);
        let is_header = self.line == 1 && line.starts_with(b"stamp");
        if is_header {
            self.n_more_columns = line.split(|byte| *byte == b',').count().saturating_sub(N_COLUMNS);
        }
        if is_header || line.trim_ascii().is_empty() {
            return None;
        }
        Some(self.sample(line).map_err(|fault| ImuError::Line { line: self.line, fault }))
    }

    fn sample(&mut self, line: &[u8]) -> Result<ImuSample, ImuFault> {
        let text = std::str::from_utf8(line).map_err(|_| ImuFault::NotText)?;
        let mut fields = text.trim().split(',').map(str::trim);
        let stamp = fields.next().unwrap_or_default();
        let stamp = Stamp(stamp.parse().map_err(|_| ImuFault::Stamp(stamp.to_owned()))?);
        let mut numbers = [0.0; 6];
        let limits = [(MAX_ACCELERATION, "m/s^2"); 3].into_iter().chain([(MAX_ANGULAR_RATE, "rad/s"); 3]);
        for ((number, name), (limit, unit)) in numbers.iter_mut().zip(HEADER.split(',').skip(1)).zip(limits) {
            let field = fields.next().ok_or(ImuFault::MissingColumn(name))?;
            let value = field.parse().ok().filter(|value: &f64| value.is_finite());
            *number = value.ok_or_else(|| ImuFault::Number { column: name, found: field.to_owned() })?;
            if number.abs() > limit {
                return Err(ImuFault::Impossible { column: name, found: field.to_owned(), limit, unit });
            }
        }
        let rest: Vec<&str> = fields.collect();
        // An empty cell may follow the last column.
        if rest.len() > self.n_more_columns && rest[self.n_more_columns..].iter().any(|cell| !cell.is_empty()) {
            let [n, n_columns] = [rest.len(), self.n_more_columns].map(|n| n + N_COLUMNS);
            return Err(ImuFault::ManyCells { n, n_columns });
        }
        if let Some(previous) = self.last.filter(|last| *last >= stamp) {
            return Err(ImuFault::NotRising { stamp, previous });
        }
        self.last = Some(stamp);
        let [ax, ay, az, wx, wy, wz] = numbers;
        let in_body = |of_unit: [f64; 3]| {
            self.body_from_unit.map_or(of_unit, |body_from_unit| (body_from_unit * Vector3::from(of_unit)).into())
        };
        let stamp = stamp.plus_nanos(self.delay_nanos.saturating_neg());
        Ok(ImuSample { stamp, acceleration: in_body([ax, ay, az]), angular_rate: in_body([wx, wy, wz]) })
    }
}

/// Reads a file line by line.
#[derive(Debug)]
pub struct ImuReader<R> {
    lines: R,
    parser: ImuParser,
    failed: bool,
}

impl<R: BufRead> ImuReader<R> {
    /// A reader at the beginning of a file.
    pub fn new(lines: R) -> Self {
        Self { lines, parser: ImuParser::default(), failed: false }
    }

    /// Returns the reader for a unit with other axes than the body, as [`ImuParser::rotated`].
    #[must_use]
    pub fn rotated(self, body_from_unit: UnitQuaternion<f64>) -> Self {
        Self { parser: self.parser.rotated(body_from_unit), ..self }
    }

    /// Returns the reader for a unit whose stamps are late, as [`ImuParser::delayed`].
    #[must_use]
    pub fn delayed(self, delay_nanos: i64) -> Self {
        Self { parser: self.parser.delayed(delay_nanos), ..self }
    }

    /// The next line; `None` at the end of the file.
    fn next_line(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut line = Vec::new();
        if self.lines.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        if line.len() as u64 == MAX_LINE && line.last() != Some(&b'\n') {
            skip_line(&mut self.lines)?;
        }
        Ok(Some(line))
    }
}

impl<R: BufRead> Iterator for ImuReader<R> {
    type Item = Result<ImuSample, ImuError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.failed {
            let line = match self.next_line() {
                Ok(line) => line?,
                Err(error) => {
                    self.failed = true;
                    return Some(Err(error.into()));
                }
            };
            if let Some(sample) = self.parser.take(&line) {
                return Some(sample);
            }
        }
        None
    }
}

/// Skips to the end of the line in bounded memory.
fn skip_line(lines: &mut impl BufRead) -> io::Result<()> {
    loop {
        let buffer = lines.fill_buf()?;
        match buffer.iter().position(|byte| *byte == b'\n') {
            Some(at) => {
                lines.consume(at + 1);
                return Ok(());
            }
            None if buffer.is_empty() => return Ok(()),
            None => {
                let length = buffer.len();
                lines.consume(length);
            }
        }
    }
}

/// Content of a file. Numbers are written with as many digits as needed to read back the same bits.
pub fn csv_from_samples(samples: &[ImuSample]) -> String {
    let mut text = format!("{HEADER}\n");
    for sample in samples {
        let [ax, ay, az] = sample.acceleration;
        let [wx, wy, wz] = sample.angular_rate;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{ax},{ay},{az},{wx},{wy},{wz}", sample.stamp.0);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples() -> Vec<ImuSample> {
        let sample = |i: i64| ImuSample {
            stamp: Stamp(1_700_000_000_000_000_001 + i * 5_000_000),
            acceleration: [0.1 * i as f64, -1e-17, 9.81],
            angular_rate: [1.0 / 3.0, -0.0, i as f64],
        };
        (0..40).map(sample).collect()
    }

    #[test]
    fn samples_survive_round_trip_bit_for_bit() {
        let text = csv_from_samples(&samples());
        let back: Vec<_> = ImuReader::new(text.as_bytes()).map(|sample| sample.expect("reads")).collect();
        assert_eq!(back, samples());
    }

    #[test]
    fn samples_of_rotated_unit_are_in_body_axes() {
        let text = format!("{HEADER}\n1,1,2,9.81,0.1,0.2,0.3\n");
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let samples: Vec<_> =
            ImuReader::new(text.as_bytes()).rotated(quarter).map(|sample| sample.expect("reads")).collect();
        let [x, y, z] = samples[0].acceleration;
        assert!((x + 2.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12 && (z - 9.81).abs() < 1e-12, "{samples:?}");
        assert!((samples[0].angular_rate[0] + 0.2).abs() < 1e-12, "{samples:?}");
    }

    #[test]
    fn decimal_commas_are_bad_lines_and_named_columns_are_not() {
        let mut parser = ImuParser::default();
        assert!(parser.take(b"\xef\xbb\xbfstamp,ax,ay,az,wx,wy,wz,temperature").is_none());
        let mut take = |line: &str| parser.take(line.as_bytes()).expect("is a line").map_err(|error| error.to_string());
        assert!(take("1,0.1,0.2,9.8,0,0,0,25").is_ok() && take("2,0.1,0.2,9.8,0,0,0").is_ok());
        assert!(take("3,0.1,0.2,9.8,0,0,0,25,").is_ok());
        let error = take("4,0,1,0,2,9,8,0,0,0,0,0,0").expect_err("is refused");
        assert!(error.contains("13 cells for 8 columns"), "{error}");
    }

    #[test]
    fn values_that_no_vehicle_reaches_are_bad_lines() {
        let text = format!(
            "{HEADER}\n1,1000,0,-1000,100,0,-100\n2,1e9,0,9.81,0,0,0\n3,0,0,-1000.1,0,0,0\n4,0,0,9.81,0,100.1,0\n5,0,0,1e300,0,0,0\n"
        );
        let (good, bad): (Vec<_>, Vec<_>) = ImuReader::new(text.as_bytes()).partition(Result::is_ok);
        assert_eq!((good.len(), bad.len()), (1, 4));
        let texts: Vec<String> = bad.into_iter().map(|error| error.expect_err("is bad").to_string()).collect();
        assert_eq!(texts[0], "line 3: ax 1e9 must be -1000 to 1000 m/s^2");
        assert_eq!(texts[2], "line 5: wy 100.1 must be -100 to 100 rad/s");
    }

    #[test]
    fn bad_lines_are_reported_and_affect_no_other_line() {
        let mut lines: Vec<String> = csv_from_samples(&samples()).lines().map(str::to_owned).collect();
        lines[5] = lines[4].clone();
        lines[7] = lines[7].replace("9.81", "fast");
        lines[9] = "1,".repeat(5000);
        lines[11] = "12".into();
        let text = lines.join("\r\n");
        let (good, bad): (Vec<_>, Vec<_>) = ImuReader::new(text.as_bytes()).partition(Result::is_ok);
        assert_eq!(good.len(), 36);
        let texts: Vec<String> = bad.into_iter().map(|error| error.expect_err("is bad").to_string()).collect();
        for (text, start) in
            texts.iter().zip(["line 6: stamp", "line 8: az \"fast\"", "line 10", "line 12: ax is missing"])
        {
            assert!(text.starts_with(start), "{text}");
        }
        assert_eq!(texts.len(), 4);
    }
}
