//! Publishes a recorded drive sweep by sweep.

use crate::Settings;
use crate::publish::{
    PublishError, count_all, no_doubts, publish_fixes, publish_image, publish_mosaic, publish_rows, publish_sweep,
    report_doubts,
};
use crate::sweep;
use acquisition::counters::ReportedCounts;
use acquisition::doubts::Tally;
use acquisition::error::DriveError;
use acquisition::recorded::{CameraFileError, DrivePosition, DriveReader, NextSweep, Part, Trigger, wrong_captures};
use formats::drive::{Drive, SweepInfo};
use messages::{ImuTopic, SweepTopic};
use serde::{Deserialize, Serialize};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};

/// Incremented when the saved state changes its meaning.
const STATE_VERSION: u32 = 5;
/// Damaged files that are reported one by one; the counters include all of them.
const MAX_REPORTED: usize = 10;

/// A drive, and what has been published and reported of it.
pub(crate) struct Recorded {
    settings: Settings,
    reader: DriveReader,
    tally: Tally,
    /// Damaged files reported so far.
    n_reported: usize,
    n_damage_reported: usize,
    reported: ReportedCounts,
    n_bad_clouds: u64,
}

#[derive(Serialize, Deserialize)]
struct SavedState {
    position: DrivePosition,
    tally: Tally,
}

impl Recorded {
    /// Problems of the drive and of the settings.
    pub(crate) fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let mut problems = Vec::new();
        if settings.end_s > 0.0 && settings.end_s <= settings.start_s {
            let text = format!("value {} must be after start_s = {}, or 0", settings.end_s, settings.start_s);
            problems.push(Problem::of_key("end_s", text));
        }
        // A missing drive may be simulated first; the supervisor checks that.
        if !context.drive.exists() {
            return problems;
        }
        match Drive::open(&context.drive) {
            Ok(drive) => problems.extend(wrong_captures(&drive).map(|text| Problem::of_key("", text))),
            Err(error) => {
                problems.extend(error.problems.iter().map(|problem| Problem::of_key("", problem.to_string())));
            }
        }
        problems
    }

    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let Settings { start_s, end_s, min_turn, trigger_hz, trigger_m, .. } = *settings;
        let part = Part { start_s, end_s, min_turn };
        let reader = DriveReader::open(&context.drive, part, Trigger::new(trigger_hz, trigger_m));
        Ok(Self {
            settings: settings.clone(),
            reader: reader.map_err(step_error)?,
            tally: Tally::default(),
            n_reported: 0,
            n_damage_reported: 0,
            reported: ReportedCounts::default(),
            n_bad_clouds: 0,
        })
    }

    /// Publishes the next tick.
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let next = self.next_sweep(outputs)?;
        self.count_losses(outputs);
        let Some((loan, sweep)) = next else {
            if !self.reader.has_begun() {
                // A restart reads the same drive with the same settings.
                return Err(StepError::configuration(self.reader.no_sweep()));
            }
            count_all([("frames_after_sweeps", self.reader.n_frames_left())], outputs);
            outputs.set_progress(1.0);
            return Ok(Flow::End);
        };
        if !self.reader.has_begun() {
            self.report_initial(outputs);
            self.begin(sweep.stamp.0, outputs);
        }
        publish_sweep(loan, &sweep, self.reader.drive().lidar().n_rings(), outputs)?;
        let end = sweep.stamp.0 + i64::from(sweep.duration_nanos);
        self.publish_others(end, outputs)?;
        outputs.set_drive_time(sweep.stamp.0);
        outputs.set_progress(self.reader.source().progress());
        Ok(Flow::Continue)
    }

    /// The next sweep to publish; `None` at the end of the drive or of the part to read.
    fn next_sweep(&mut self, outputs: &mut Outputs) -> Result<Option<(Loan<SweepTopic>, SweepInfo)>, StepError> {
        loop {
            let mut loan = sweep::loan(outputs)?;
            match sweep::fill(&mut loan, |sink| self.reader.next_sweep(sink).map_err(StepError::data))? {
                NextSweep::Sweep(sweep) => return Ok(Some((loan, sweep))),
                NextSweep::Early => {}
                NextSweep::Partial => outputs.count("partial_sweeps", 1),
                NextSweep::End => return Ok(None),
            }
        }
    }

    /// Publishes the measurements of the other sensors up to the end of the sweep.
    fn publish_others(&mut self, end: i64, outputs: &mut Outputs) -> Result<(), StepError> {
        let due = self.reader.take_before(end);
        let mut errors = Vec::new();
        for frame in due.images {
            let Some(entry) = due.manifest.cameras.get(frame.camera) else { continue };
            let is_bad = keep_file_error(publish_image(frame, entry, outputs), "bad_images", &mut errors)?;
            self.tally.images.add(is_bad);
        }
        for frame in due.mosaics {
            let Some(entry) = due.manifest.mosaics.get(frame.camera) else { continue };
            let is_bad = keep_file_error(publish_mosaic(frame, entry, outputs), "bad_mosaics", &mut errors)?;
            self.tally.mosaics.add(is_bad);
        }
        self.tally.fixes += due.fixes.len() as u64;
        self.tally.gnss_rows += publish_fixes(&due.fixes, outputs)?;
        publish_rows::<ImuTopic>(&due.samples, due.samples.first().map(|row| row.stamp), outputs)?;
        self.tally.imu_samples += due.samples.len() as u64;
        let (n_bad, error) = due.bad_imu_lines;
        self.tally.bad_imu_lines += n_bad;
        count_all([("bad_imu_lines", n_bad)], outputs);
        for (counter, error) in errors {
            outputs.count(counter, 1);
            self.report(error.to_string(), outputs);
        }
        if let Some(error) = error {
            self.report(format!("imu: {error}"), outputs);
        }
        Ok(())
    }

    /// Reports a damaged file to the operator, unless there were too many.
    fn report(&mut self, text: String, outputs: &mut Outputs) {
        match self.n_reported {
            n if n < MAX_REPORTED => outputs.note(text),
            MAX_REPORTED => outputs.note("more files are damaged; see the counters"),
            _ => {}
        }
        self.n_reported += 1;
    }

    fn report_initial(&self, outputs: &mut Outputs) {
        let (initial, drive) = (self.reader.initial_counts(), self.reader.drive());
        count_all(initial.named(), outputs);
        if drive.is_inferred() {
            let (model, format) = (drive.model().name(), &drive.manifest().lidar.format);
            outputs.note(format!("no drive.toml: reading {format} sweeps of one {model} without other sensors"));
        }
        if let Some(path) = drive.strange_files().first() {
            outputs.note(format!("{}: the file name is not a stamp in ns; such files are skipped", path.display()));
        }
    }

    /// Skips measurements of other sensors before the first sweep.
    fn begin(&mut self, begin: i64, outputs: &mut Outputs) {
        let skipped = self.reader.begin(begin);
        count_all([("frames_before_sweeps", skipped.frames), ("bad_imu_lines", skipped.bad_imu_lines)], outputs);
        self.tally.bad_imu_lines += skipped.bad_imu_lines;
    }

    /// Adds packets and files lost or damaged since the last call to the run summary.
    fn count_losses(&mut self, outputs: &mut Outputs) {
        let source = self.reader.source();
        count_all(self.reported.take_new(source.lidar_stats(), self.reader.packet_log_stats()), outputs);
        let n_bad = source.n_bad_clouds();
        if n_bad > self.n_bad_clouds {
            outputs.count("bad_sweeps", n_bad - self.n_bad_clouds);
            self.n_bad_clouds = n_bad;
        }
        let new: Vec<String> = source.damage().iter().skip(self.n_damage_reported).cloned().collect();
        self.n_damage_reported += new.len();
        for text in new {
            self.report(text, outputs);
        }
    }

    /// Reports the doubts about what was read.
    pub(crate) fn finish(&self, outputs: &mut Outputs) {
        let (source, initial, tally) = (self.reader.source(), self.reader.initial_counts(), &self.tally);
        let mut doubts = no_doubts(&self.settings);
        doubts.captures(&source.lidar_stats(), source.capture_bytes());
        let n_bad_clouds = source.n_bad_clouds();
        doubts.files(tally, self.reader.n_sweeps() + n_bad_clouds, n_bad_clouds);
        if self.reader.drive().manifest().gnss.is_some() {
            doubts.log(&initial.log, initial.n_fixes - initial.without_height, initial.n_fixes);
        } else {
            doubts.log(&source.log_stats(), tally.gnss_rows, tally.fixes);
        }
        if let Some((n_outside, n_frames)) = self.reader.frames_outside() {
            doubts.outside(n_outside, n_frames);
        }
        doubts.silent(&self.reader.silent_sensors(tally.fixes, tally.imu_samples));
        report_doubts(doubts, outputs);
    }

    pub(crate) fn save(&mut self) -> Result<Vec<u8>, StepError> {
        let state = SavedState { position: self.reader.position(), tally: self.tally };
        Ok(encode_state(STATE_VERSION, &state)?)
    }

    pub(crate) fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let state: SavedState = decode_state(STATE_VERSION, state)?;
        self.reader.resume(state.position).map_err(step_error)?;
        self.tally = state.tally;
        let source = self.reader.source();
        self.reported = ReportedCounts::up_to(source.lidar_stats(), self.reader.packet_log_stats());
        self.n_bad_clouds = source.n_bad_clouds();
        Ok(())
    }
}

fn step_error(error: DriveError) -> StepError {
    if let DriveError::Log(_) = error { StepError::io(error) } else { StepError::data(error) }
}

/// Collects errors of damaged files and returns whether there is one; other errors end the step.
fn keep_file_error(
    result: Result<(), PublishError>,
    counter: &'static str,
    errors: &mut Vec<(&'static str, CameraFileError)>,
) -> Result<bool, StepError> {
    match result {
        Ok(()) => Ok(false),
        Err(PublishError::Step(error)) => Err(error),
        Err(PublishError::File(error)) => {
            errors.push((counter, error));
            Ok(true)
        }
    }
}
