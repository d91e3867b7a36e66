//! IMU samples as CSV.

use super::messages::Imu;
use formats::imu::{HEADER, MAX_ACCELERATION, MAX_ANGULAR_RATE};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Name of the log in the drive.
pub(crate) const FILE: &str = "imu.csv";
/// Samples that show the unit of the accelerations.
const EXAMINED: usize = 200;
/// Length of the mean acceleration in g, within which no vehicle measures m/s^2.
const IN_G: std::ops::Range<f64> = 0.5..2.0;
/// Standard gravity, m/s^2.
const GRAVITY_MPS2: f64 = 9.806_65;

/// A sample.
struct Sample {
    stamp: i64,
    acceleration: [f64; 3],
    angular_rate: [f64; 3],
}

/// Writes the log.
pub(crate) struct ImuLog {
    log: BufWriter<File>,
    waiting: Vec<Sample>,
    /// Accelerations are multiplied by this; `None` while samples wait.
    scale: Option<f64>,
    last: Option<i64>,
    pub n_samples: u64,
    /// Samples that are not later than the one before.
    pub n_late: u64,
    /// Samples without values, or with values beyond those of a vehicle.
    pub n_bad: u64,
}

impl ImuLog {
    pub fn create(folder: &Path) -> io::Result<Self> {
        let mut log = BufWriter::new(File::create(folder.join(FILE))?);
        writeln!(log, "{HEADER}")?;
        Ok(Self { log, waiting: Vec::new(), scale: None, last: None, n_samples: 0, n_late: 0, n_bad: 0 })
    }

    pub fn add(&mut self, stamp: i64, message: &Imu) -> io::Result<()> {
        let Imu { acceleration, angular_rate, .. } = *message;
        let is_within = |values: [f64; 3], limit: f64| values.iter().all(|value| value.abs() <= limit);
        if !message.is_complete
            || !is_within(acceleration, MAX_ACCELERATION)
            || !is_within(angular_rate, MAX_ANGULAR_RATE)
        {
            self.n_bad += 1;
            return Ok(());
        }
        if self.last.is_some_and(|last| last >= stamp) {
            self.n_late += 1;
            return Ok(());
        }
        self.last = Some(stamp);
        self.n_samples += 1;
        let sample = Sample { stamp, acceleration, angular_rate };
        if let Some(scale) = self.scale {
            return self.write(&sample, scale);
        }
        self.waiting.push(sample);
        if self.waiting.len() == EXAMINED { self.decide() } else { Ok(()) }
    }

    fn decide(&mut self) -> io::Result<()> {
        let norm = |sample: &Sample| sample.acceleration.iter().map(|value| value * value).sum::<f64>().sqrt();
        let mean = self.waiting.iter().map(norm).sum::<f64>() / self.waiting.len().max(1) as f64;
        let scale = if IN_G.contains(&mean) { GRAVITY_MPS2 } else { 1.0 };
        self.scale = Some(scale);
        for sample in std::mem::take(&mut self.waiting) {
            self.write(&sample, scale)?;
        }
        Ok(())
    }

    fn write(&mut self, sample: &Sample, scale: f64) -> io::Result<()> {
        let Sample { stamp, acceleration: [ax, ay, az], angular_rate: [wx, wy, wz] } = sample;
        writeln!(self.log, "{stamp},{},{},{},{wx},{wy},{wz}", ax * scale, ay * scale, az * scale)
    }

    /// Whether the accelerations were in g.
    pub fn finish(&mut self) -> io::Result<bool> {
        if self.scale.is_none() {
            self.decide()?;
        }
        self.log.flush()?;
        Ok(self.scale != Some(1.0))
    }
}
