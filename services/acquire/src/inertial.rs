//! Inertial samples as a stream: hours of them stay on disk.

use formats::imu::{ImuError, ImuReader, ImuSample};
use messages::ImuRow;
use std::fs::File;
use std::io::BufReader;

/// A tick has 20 samples at 200 Hz; after a gap in the sweeps there may be more, which come with the next ticks.
const MAX_ROWS: usize = 10_000;

/// The log with one sample in hand.
pub(crate) struct Inertial {
    reader: Option<ImuReader<BufReader<File>>>,
    ahead: Option<ImuSample>,
    n_bad: u64,
    fault: Option<String>,
}

impl Inertial {
    /// `None`: the drive has no such sensor.
    pub(crate) fn new(reader: Option<ImuReader<BufReader<File>>>) -> Self {
        let mut inertial = Self { reader, ahead: None, n_bad: 0, fault: None };
        inertial.advance();
        inertial
    }

    /// Passes over samples before `begin`, with the bad lines among them, which were counted when they were first read.
    pub(crate) fn skip_before(&mut self, begin: i64) {
        while self.ahead.is_some_and(|sample| sample.stamp.0 < begin) {
            self.advance();
        }
        (self.n_bad, self.fault) = (0, None);
    }

    /// The samples before `end`.
    pub(crate) fn take_before(&mut self, end: i64) -> Vec<ImuRow> {
        let mut rows = Vec::new();
        while rows.len() < MAX_ROWS {
            let Some(sample) = self.ahead.filter(|sample| sample.stamp.0 < end) else { break };
            let ImuSample { stamp, acceleration, angular_rate } = sample;
            rows.push(ImuRow { stamp: stamp.0, acceleration, angular_rate });
            self.advance();
        }
        rows
    }

    /// Bad lines since the last call, and what is wrong with the first of them.
    pub(crate) fn take_faults(&mut self) -> (u64, Option<String>) {
        (std::mem::take(&mut self.n_bad), self.fault.take())
    }

    /// Stamp of the sample in hand: everything before it has been taken.
    pub(crate) fn position(&self) -> i64 {
        self.ahead.map_or(i64::MAX, |sample| sample.stamp.0)
    }

    fn advance(&mut self) {
        self.ahead = None;
        while let Some(next) = self.reader.as_mut().and_then(Iterator::next) {
            match next {
                Ok(sample) => {
                    self.ahead = Some(sample);
                    return;
                }
                Err(error @ (ImuError::Line { .. } | ImuError::Io(_))) => {
                    self.n_bad += 1;
                    self.fault.get_or_insert(error.to_string());
                }
            }
        }
    }
}
