//! IMU samples as CSV.

use super::messages::Imu;
use drive::imu::{HEADER, MAX_ACCELERATION, MAX_ANGULAR_RATE};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Name of the log in the drive.
pub(crate) const FILE: &str = "imu.csv";
/// Number of samples from which the unit of the accelerations is determined.
const EXAMINED: usize = 200;
/// Length of the mean acceleration that indicates g: no vehicle measures it in m/s^2.
const IN_G: std::ops::Range<f64> = 0.5..2.0;
/// Standard gravity, m/s^2.
const GRAVITY_MPS2: f64 = 9.806_65;

/// A sample.
struct Sample {
    stamp: i64,
    acceleration: [f64; 3],
    angular_rate: [f64; 3],
}

/// Reason why a sample is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum LeftOut {
    #[error("no values, or values that no vehicle reaches")]
    Bad,
    #[error("its stamp is not later than the stamp of the previous sample")]
    Late,
}

/// Converts samples to lines of the log. Accelerations in g become m/s^2.
pub(crate) struct ImuLines {
    /// Number of samples from which the unit is determined.
    examined: usize,
    waiting: Vec<Sample>,
    /// Factor of the accelerations; `None` while samples wait.
    scale: Option<f64>,
    last: Option<i64>,
}

impl ImuLines {
    pub fn new(examined: usize) -> Self {
        Self { examined, waiting: Vec::new(), scale: None, last: None }
    }

    /// The lines that are complete with this sample.
    pub fn add(&mut self, stamp: i64, message: &Imu) -> Result<Vec<String>, LeftOut> {
        let Imu { acceleration, angular_rate, .. } = *message;
        let is_within = |values: [f64; 3], limit: f64| values.iter().all(|value| value.abs() <= limit);
        if !message.is_complete
            || !is_within(acceleration, MAX_ACCELERATION)
            || !is_within(angular_rate, MAX_ANGULAR_RATE)
        {
            return Err(LeftOut::Bad);
        }
        if self.last.is_some_and(|last| last >= stamp) {
            return Err(LeftOut::Late);
        }
        self.last = Some(stamp);
        let sample = Sample { stamp, acceleration, angular_rate };
        if let Some(scale) = self.scale {
            return Ok(vec![sample.line(scale)]);
        }
        self.waiting.push(sample);
        Ok(if self.waiting.len() == self.examined { self.finish() } else { Vec::new() })
    }

    /// The lines of the waiting samples.
    pub fn finish(&mut self) -> Vec<String> {
        let waiting = std::mem::take(&mut self.waiting);
        let scale = *self.scale.get_or_insert_with(|| {
            let norm = |sample: &Sample| sample.acceleration.iter().map(|value| value * value).sum::<f64>().sqrt();
            let mean = waiting.iter().map(norm).sum::<f64>() / waiting.len().max(1) as f64;
            if IN_G.contains(&mean) { GRAVITY_MPS2 } else { 1.0 }
        });
        waiting.iter().map(|sample| sample.line(scale)).collect()
    }

    /// Whether the accelerations are in g.
    pub fn is_in_g(&self) -> bool {
        self.scale.is_some_and(|scale| scale != 1.0)
    }
}

impl Sample {
    fn line(&self, scale: f64) -> String {
        let Sample { stamp, acceleration: [ax, ay, az], angular_rate: [wx, wy, wz] } = self;
        format!("{stamp},{},{},{},{wx},{wy},{wz}", ax * scale, ay * scale, az * scale)
    }
}

/// Writes the log.
pub(crate) struct ImuLog {
    log: BufWriter<File>,
    lines: ImuLines,
    pub n_samples: u64,
    /// Samples that are not later than the previous one.
    pub n_late: u64,
    /// Samples without values, or with values that no vehicle reaches.
    pub n_bad: u64,
}

impl ImuLog {
    pub fn create(folder: &Path) -> io::Result<Self> {
        let mut log = BufWriter::new(File::create(folder.join(FILE))?);
        writeln!(log, "{HEADER}")?;
        Ok(Self { log, lines: ImuLines::new(EXAMINED), n_samples: 0, n_late: 0, n_bad: 0 })
    }

    pub fn add(&mut self, stamp: i64, message: &Imu) -> io::Result<()> {
        match self.lines.add(stamp, message) {
            Ok(lines) => {
                self.n_samples += 1;
                self.write(&lines)?;
            }
            Err(LeftOut::Bad) => self.n_bad += 1,
            Err(LeftOut::Late) => self.n_late += 1,
        }
        Ok(())
    }

    fn write(&mut self, lines: &[String]) -> io::Result<()> {
        lines.iter().try_for_each(|line| writeln!(self.log, "{line}"))
    }

    /// Whether the accelerations were in g.
    pub fn finish(&mut self) -> io::Result<bool> {
        let lines = self.lines.finish();
        self.write(&lines)?;
        self.log.flush()?;
        Ok(self.lines.is_in_g())
    }
}
