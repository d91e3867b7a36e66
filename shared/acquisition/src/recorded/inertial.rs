//! Inertial samples, read as a stream so that hours of them stay on disk.

use drive::imu::{ImuError, ImuReader, ImuSample};
use messages::ImuRow;
use std::fs::File;
use std::io::BufReader;

/// Largest number of samples per tick. A tick has 20 at 200 Hz; after a gap in the sweeps the rest follow in the next
/// ticks.
const MAX_ROWS: usize = 10_000;

/// Damaged lines of the log.
#[derive(Default)]
pub struct BadLines {
    /// Their number.
    pub n: u64,
    /// Error of the first one.
    pub first: Option<ImuError>,
}

/// The log with a look-ahead of one sample.
pub(crate) struct Inertial {
    reader: Option<ImuReader<BufReader<File>>>,
    ahead: Option<ImuSample>,
    /// Damaged lines since the last call of [`Inertial::take_errors`].
    bad: BadLines,
}

impl Inertial {
    /// Opens the log. `None`: the drive has no such sensor.
    pub(crate) fn new(reader: Option<ImuReader<BufReader<File>>>) -> Self {
        let mut inertial = Self { reader, ahead: None, bad: BadLines::default() };
        inertial.advance();
        inertial
    }

    /// Skips samples before `begin`. Returns the damaged lines before them; later ones count as after `begin`.
    pub(crate) fn skip_before(&mut self, begin: i64) -> BadLines {
        let mut skipped = BadLines::default();
        while self.ahead.is_some_and(|sample| sample.stamp.0 < begin) {
            let bad = self.take_errors();
            skipped.n += bad.n;
            skipped.first = skipped.first.or(bad.first);
            self.advance();
        }
        skipped
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

    /// Damaged lines since the last call.
    pub(crate) fn take_errors(&mut self) -> BadLines {
        std::mem::take(&mut self.bad)
    }

    /// Stamp of the next sample.
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
                    self.bad.n += 1;
                    self.bad.first.get_or_insert(error);
                }
            }
        }
    }
}
