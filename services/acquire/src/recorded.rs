//! Publishes a recorded drive sweep by sweep.

use crate::Settings;
use crate::publish::{
    no_doubts, publish_fixes, publish_image, publish_mosaic, publish_secondary, publish_sweep, report, report_doubts,
};
use crate::sweep;
use acquisition::error::DriveError;
use acquisition::recorded::{DriveAccount, DriveReader, News, NextSweep, Part, SavedDrive, Trigger, drive_problems};
use drive::SweepInfo;
use messages::{ImuTopic, SweepTopic};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};

/// Incremented when the saved state changes its meaning.
const STATE_VERSION: u32 = 11;

/// A sweep, and the message with its points.
struct ReadSweep {
    loan: Loan<SweepTopic>,
    sweep: SweepInfo,
}

/// A drive, and its published and reported data.
pub(crate) struct Recorded {
    settings: Settings,
    reader: DriveReader,
    account: DriveAccount,
}

impl Recorded {
    /// Problems of the drive and of the settings.
    pub(crate) fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let mut problems = Vec::new();
        if settings.end_s > 0.0 && settings.end_s <= settings.start_s {
            let text = format!("value {} must be after start_s = {}, or 0", settings.end_s, settings.start_s);
            problems.push(Problem::for_key("end_s", text));
        }
        problems.extend(drive_problems(&context.drive).into_iter().map(|text| Problem::for_key("", text)));
        problems
    }

    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let Settings { start_s, end_s, min_turn, trigger_hz, trigger_m, .. } = *settings;
        let part = Part { start_s, end_s, min_turn };
        let reader = DriveReader::open(&context.drive, part, Trigger::new(trigger_hz, trigger_m));
        Ok(Self { settings: settings.clone(), reader: reader.map_err(step_error)?, account: DriveAccount::default() })
    }

    /// Publishes the next tick.
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let next = self.next_sweep(outputs)?;
        self.account.add_losses(&mut self.reader);
        report(self.account.take_news(), outputs);
        let Some(ReadSweep { loan, sweep }) = next else {
            if !self.reader.has_begun() {
                // A restart reads the same drive with the same settings.
                return Err(StepError::configuration(self.reader.no_sweep()));
            }
            outputs.count_all([("frames_after_sweeps", self.reader.n_frames_left())]);
            outputs.set_progress(1.0);
            return Ok(Flow::End);
        };
        if !self.reader.has_begun() {
            self.begin(sweep.stamp.0, outputs);
        }
        publish_sweep(loan, &sweep, self.reader.drive().lidar().n_rings(), outputs)?;
        self.publish_secondary_lidars(&sweep, outputs)?;
        let end = sweep.stamp.0 + i64::from(sweep.duration_nanos);
        self.publish_others(end, outputs)?;
        outputs.set_drive_time(sweep.stamp.0);
        outputs.set_progress(self.reader.source().progress());
        Ok(Flow::Continue)
    }

    /// The next sweep to publish; `None` at the end of the drive or of the part to read.
    fn next_sweep(&mut self, outputs: &mut Outputs) -> Result<Option<ReadSweep>, StepError> {
        loop {
            let mut loan = sweep::loan(outputs)?;
            match sweep::fill(&mut loan, |sink| self.reader.next_sweep(sink).map_err(StepError::data))? {
                NextSweep::Sweep(sweep) => return Ok(Some(ReadSweep { loan, sweep })),
                NextSweep::Early => {}
                NextSweep::Partial => outputs.count("partial_sweeps", 1),
                NextSweep::End => return Ok(None),
            }
        }
    }

    /// Publishes the points of the secondary LiDARs during the sweep.
    fn publish_secondary_lidars(&mut self, sweep: &SweepInfo, outputs: &mut Outputs) -> Result<(), StepError> {
        for index in 0..self.reader.n_secondary_lidars() {
            let reader = &mut self.reader;
            publish_secondary(
                |sink| reader.next_sweep_of_secondary(index, sweep, sink).map_err(StepError::data),
                outputs,
            )?;
            // Counted before the state is saved, which has the counts.
            self.account.add_losses(&mut self.reader);
        }
        report(self.account.take_news(), outputs);
        Ok(())
    }

    /// Publishes the measurements of the other sensors up to the end of the sweep.
    fn publish_others(&mut self, end: i64, outputs: &mut Outputs) -> Result<(), StepError> {
        let due = self.reader.take_before(end);
        let tally = &mut self.account.tally;
        let mut damaged = Vec::new();
        for frame in due.images {
            let Some(entry) = due.manifest.cameras.get(frame.camera) else { continue };
            let error = publish_image(frame, entry, outputs)?;
            tally.images.add(error.is_some());
            damaged.extend(error.map(|error| ("bad_images", error)));
        }
        for frame in due.mosaics {
            let Some(entry) = due.manifest.mosaics.get(frame.camera) else { continue };
            let error = publish_mosaic(frame, entry, outputs)?;
            tally.mosaics.add(error.is_some());
            damaged.extend(error.map(|error| ("bad_mosaics", error)));
        }
        let n_gnss_rows = publish_fixes(&due.fixes, outputs)?;
        outputs.publish_rows::<ImuTopic>(&due.samples, |row| row.stamp)?;
        self.account.add_published(&due, n_gnss_rows, damaged);
        report(self.account.take_news(), outputs);
        Ok(())
    }

    /// Skips measurements of other sensors before the first sweep.
    fn begin(&mut self, begin: i64, outputs: &mut Outputs) {
        report(News::initial(&self.reader), outputs);
        self.account.add_skipped(&self.reader.begin(begin));
        report(self.account.take_news(), outputs);
    }

    /// Reports the doubts about the data that was read.
    pub(crate) fn finish(&self, outputs: &mut Outputs) {
        let mut doubts = no_doubts(&self.settings);
        self.account.doubt(&self.reader, &mut doubts);
        report_doubts(doubts, outputs);
    }

    pub(crate) fn save(&mut self) -> Result<Vec<u8>, StepError> {
        Ok(encode_state(STATE_VERSION, &self.account.save(&self.reader))?)
    }

    pub(crate) fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let state: SavedDrive = decode_state(STATE_VERSION, state)?;
        self.account = DriveAccount::resumed(state, &mut self.reader).map_err(step_error)?;
        Ok(())
    }
}

fn step_error(error: DriveError) -> StepError {
    if let DriveError::Log(_) = error { StepError::io(error) } else { StepError::data(error) }
}
