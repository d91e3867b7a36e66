//! Lines of the GNSS receiver and of the IMU as rows of ticks.

use crate::error::LiveError;
use crate::live::clocks::Clocks;
use crate::live::lines::{Line, LineLog};
use drive::imu::{ImuError, ImuParser, ImuSample};
use drive::manifest::GnssEntry;
use lidar::nmea::{self, Fix, FixJoiner, LogStats, Sentence};
use messages::ImuRow;
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};

/// Largest number of fixes per tick, as in a recorded drive.
const MAX_FIXES: usize = 4096;
/// Largest number of samples per tick, as in a recorded drive.
const MAX_SAMPLES: usize = 10_000;
/// Largest number of measurements that wait for their sweep. A clock that is ahead of the LiDAR's would otherwise fill
/// the memory.
const MAX_WAITING: usize = 100_000;
/// Names among the clocks.
const GNSS: &str = "gnss";
const IMU: &str = "imu";

/// The receiver.
pub(super) struct FixLog {
    path: PathBuf,
    log: LineLog,
    joiner: FixJoiner,
    /// Delay of the stamps.
    delay_nanos: i64,
    waiting: VecDeque<Fix>,
    is_closed: bool,
    n_left_out: u64,
    n_interruptions: u64,
}

/// Fixes that were just read, and fixes up to the last sweep.
pub(super) struct TakenFixes {
    pub(super) new: Vec<Fix>,
    pub(super) due: Vec<Fix>,
}

impl FixLog {
    pub(super) fn new(path: PathBuf, log: LineLog, entry: Option<&GnssEntry>) -> Self {
        let joiner = FixJoiner::default().above_geoid(entry.and_then(|entry| entry.geoid_m));
        let delay_nanos = entry.map_or(0, |entry| entry.delay_nanos);
        let waiting = VecDeque::new();
        Self { path, log, joiner, delay_nanos, waiting, is_closed: false, n_left_out: 0, n_interruptions: 0 }
    }

    pub(super) fn take_due(&mut self, span: Option<[i64; 2]>, clocks: &mut Clocks) -> Result<TakenFixes, LiveError> {
        let mut new = Vec::new();
        while let Some(line) = next_line(&mut self.log, &self.path)? {
            // Only this sentence has the date, so its stamp can be compared.
            if let (Ok(Sentence::Rmc(rmc)), Some(arrived)) = (nmea::sentence(&line.text), line.arrived)
                && let Some(stamp) = rmc.stamp
            {
                clocks.add(GNSS, stamp.plus_nanos(self.delay_nanos.saturating_neg()), arrived);
            }
            new.extend(self.joiner.take(&line.text));
        }
        if self.is_closed {
            new.extend(self.joiner.finish());
        }
        for fix in &mut new {
            fix.stamp = fix.stamp.plus_nanos(self.delay_nanos.saturating_neg());
        }
        self.waiting.extend(&new);
        let n_excess = self.waiting.len().saturating_sub(MAX_WAITING);
        self.waiting.drain(..n_excess);
        self.n_left_out += n_excess as u64;
        let due = take_due(&mut self.waiting, |fix| fix.stamp.0, span, MAX_FIXES);
        Ok(TakenFixes { new, due })
    }

    pub(super) fn stats(&self) -> LogStats {
        self.joiner.stats().in_file(&self.path.file_name().unwrap_or_default().to_string_lossy())
    }

    pub(super) fn take_counts(&mut self) -> [(&'static str, u64); 2] {
        [
            ("gnss_interruptions", take_new(self.log.n_interruptions(), &mut self.n_interruptions)),
            ("gnss_left_out", std::mem::take(&mut self.n_left_out)),
        ]
    }

    pub(super) fn close(&mut self) {
        self.log.close();
        self.is_closed = true;
    }
}

/// Samples that are due.
pub(super) struct TakenSamples {
    pub(super) rows: Vec<ImuRow>,
    /// Errors of damaged lines.
    pub(super) errors: Vec<ImuError>,
}

/// The IMU.
pub(super) struct SampleLog {
    path: PathBuf,
    log: LineLog,
    parser: ImuParser,
    waiting: VecDeque<ImuSample>,
    n_left_out: u64,
    n_interruptions: u64,
}

impl SampleLog {
    pub(super) fn new(path: PathBuf, log: LineLog, parser: ImuParser) -> Self {
        Self { path, log, parser, waiting: VecDeque::new(), n_left_out: 0, n_interruptions: 0 }
    }

    /// Samples up to the last sweep.
    pub(super) fn take_due(&mut self, span: Option<[i64; 2]>, clocks: &mut Clocks) -> Result<TakenSamples, LiveError> {
        let mut errors = Vec::new();
        while let Some(line) = next_line(&mut self.log, &self.path)? {
            match self.parser.take(&line.text) {
                Some(Ok(sample)) => {
                    if let Some(arrived) = line.arrived {
                        clocks.add(IMU, sample.stamp, arrived);
                    }
                    self.waiting.push_back(sample);
                }
                Some(Err(error)) => errors.push(error),
                None => {}
            }
        }
        let n_excess = self.waiting.len().saturating_sub(MAX_WAITING);
        self.waiting.drain(..n_excess);
        self.n_left_out += n_excess as u64;
        let samples = take_due(&mut self.waiting, |sample| sample.stamp.0, span, MAX_SAMPLES);
        let row = |ImuSample { stamp, acceleration, angular_rate }: ImuSample| ImuRow {
            stamp: stamp.0,
            acceleration,
            angular_rate,
        };
        Ok(TakenSamples { rows: samples.into_iter().map(row).collect(), errors })
    }

    pub(super) fn take_counts(&mut self) -> [(&'static str, u64); 2] {
        [
            ("imu_interruptions", take_new(self.log.n_interruptions(), &mut self.n_interruptions)),
            ("imu_left_out", std::mem::take(&mut self.n_left_out)),
        ]
    }

    pub(super) fn close(&mut self) {
        self.log.close();
    }
}

/// Growth of a count since the last call.
fn take_new(count: u64, before: &mut u64) -> u64 {
    count - std::mem::replace(before, count)
}

/// The next line. Fails if the thread has failed.
fn next_line(log: &mut LineLog, path: &Path) -> Result<Option<Line>, LiveError> {
    let fault = |source: io::Error| LiveError::File { path: path.to_owned(), source };
    if let Some(error) = log.take_error() {
        return Err(fault(error));
    }
    log.next_line().map_err(fault)
}

/// Takes the measurements from the first sweep up to the end of the last one; drops earlier measurements. Stamps rise.
fn take_due<T>(
    waiting: &mut VecDeque<T>,
    stamp_of: impl Fn(&T) -> i64,
    span: Option<[i64; 2]>,
    limit: usize,
) -> Vec<T> {
    let Some([begin, end]) = span else { return Vec::new() };
    let n_before = waiting.partition_point(|item| stamp_of(item) < begin);
    waiting.drain(..n_before);
    let n_due = waiting.partition_point(|item| stamp_of(item) < end);
    waiting.drain(..n_due.min(limit)).collect()
}
