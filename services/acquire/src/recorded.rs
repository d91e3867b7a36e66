//! Publishes a recorded drive sweep by sweep.

use crate::Settings;
use crate::doubts::{Doubts, Tally};
use crate::error::NoSweepError;
use crate::events::Events;
use crate::frames::{FrameError, publish_image, publish_mosaic};
use crate::inertial::Inertial;
use crate::odometer::Odometer;
use crate::publish::{ReportedCounts, publish_fixes, publish_rows, publish_sweep};
use crate::sweep;
use crate::trigger::Trigger;
use formats::drive::{Drive, Frame, SourcePosition, SweepInfo, SweepSource};
use formats::nmea::{Fix, LogStats};
use formats::velodyne::OtherModel;
use messages::{ImageTopic, ImuTopic, Message, MosaicTopic, SweepTopic};
use serde::{Deserialize, Serialize};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};

/// Incremented when the saved state changes its meaning.
const STATE_VERSION: u32 = 3;
/// Damaged files that are reported one by one; the counters include all of them.
const MAX_REPORTED: usize = 10;
/// A shorter part of a drive may lie between two fixes.
const MIN_SENSOR_NANOS: i64 = 2_000_000_000;
/// Fixes per tick at most: 200 s of a receiver at 20 Hz, after a gap in the sweeps.
const MAX_FIXES: usize = 4096;

/// A drive and the position up to which it has been published.
pub(crate) struct Recorded {
    settings: Settings,
    drive: Drive,
    source: SweepSource,
    images: Events<Frame>,
    mosaics: Events<Frame>,
    fixes: Events<Fix>,
    inertial: Inertial,
    /// Counts for the first tick.
    initial: InitialCounts,
    at: Position,
    tally: Tally,
    /// Damaged files reported so far.
    n_reported: usize,
    n_damage_reported: usize,
    reported: ReportedCounts,
    n_bad_clouds: u64,
}

/// Where the next tick begins, in addition to the source's own position.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Position {
    /// Stamp of the first sweep of the drive.
    first: Option<i64>,
    /// End of the last sweep that was read.
    end: i64,
    /// Stamp of the first sweep that was published.
    begun: Option<i64>,
    /// Whether the last sweep of the drive was read.
    is_complete: bool,
    n_sweeps: u64,
    n_partial: u64,
}

#[derive(Serialize, Deserialize)]
struct SavedState {
    source: SourcePosition,
    at: Position,
    tally: Tally,
    images: u64,
    mosaics: u64,
    fixes: u64,
    inertial: i64,
}

/// Counts that are known before the first tick.
struct InitialCounts {
    skipped_images: u64,
    skipped_mosaics: u64,
    strange_files: u64,
    log: LogStats,
    n_fixes: u64,
    without_height: u64,
}

/// Why no sweep can be read from the captures of a drive: found from their first packets, before the run starts.
fn wrong_captures(drive: &Drive) -> Option<String> {
    if drive.manifest().lidar.format != "pcap" {
        return None;
    }
    match OtherModel::find(drive.sweep_files(), drive.model()) {
        Ok(Some(other)) => Some(other.to_string()),
        Ok(None) => drive.sweeps().err().map(|error| error.to_string()),
        Err(error) => Some(error.to_string()),
    }
}

impl Recorded {
    /// Publishes the measurements of the other sensors up to the end of the sweep.
    fn publish_others(&mut self, end: i64, outputs: &mut Outputs) -> Result<(), StepError> {
        let manifest = self.drive.manifest();
        let mut errors = Vec::new();
        for frame in self.images.take_before(end, ImageTopic::QUEUE) {
            let Some(entry) = manifest.cameras.get(frame.camera) else { continue };
            let is_bad = keep_file_error(publish_image(frame, entry, outputs), "bad_images", &mut errors)?;
            self.tally.images.add(is_bad);
        }
        for frame in self.mosaics.take_before(end, MosaicTopic::QUEUE) {
            let Some(entry) = manifest.mosaics.get(frame.camera) else { continue };
            let is_bad = keep_file_error(publish_mosaic(frame, entry, outputs), "bad_mosaics", &mut errors)?;
            self.tally.mosaics.add(is_bad);
        }
        let of_packets = self.source.take_fixes();
        let fixes = if manifest.gnss.is_some() { self.fixes.take_before(end, MAX_FIXES) } else { &of_packets };
        self.tally.fixes += fixes.len() as u64;
        self.tally.gnss_rows += publish_fixes(fixes, outputs)?;
        let samples = self.inertial.take_before(end);
        publish_rows::<ImuTopic>(&samples, samples.first().map(|row| row.stamp), outputs)?;
        self.tally.imu_samples += samples.len() as u64;
        let (n_bad, error) = self.inertial.take_errors();
        self.tally.bad_imu_lines += n_bad;
        if n_bad > 0 {
            outputs.count("bad_imu_lines", n_bad);
        }
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

    fn report_initial(&mut self, outputs: &mut Outputs) {
        let initial = &self.initial;
        for (name, n) in [
            ("images_skipped_by_trigger", initial.skipped_images),
            ("mosaics_skipped_by_trigger", initial.skipped_mosaics),
            ("strange_files", initial.strange_files),
            ("bad_nmea_lines", initial.log.bad_lines),
            ("gnss_without_fix", initial.log.without_fix),
            ("gnss_out_of_order", initial.log.out_of_order),
            ("gnss_without_height", initial.without_height),
        ] {
            if n > 0 {
                outputs.count(name, n);
            }
        }
        if self.drive.is_inferred() {
            let (model, format) = (self.drive.model().name(), &self.drive.manifest().lidar.format);
            outputs.note(format!("no drive.toml: reading {format} sweeps of one {model} without other sensors"));
        }
        if let Some(path) = self.drive.strange_files().first() {
            outputs.note(format!("{}: the file name is not a stamp in ns; such files are skipped", path.display()));
        }
    }

    /// Adds packets and files lost or damaged since the last call to the run summary.
    fn count_losses(&mut self, outputs: &mut Outputs) {
        // If the drive has a log of a receiver, the sentences in the packets are not used.
        let log = if self.drive.manifest().gnss.is_some() { LogStats::default() } else { self.source.log_stats() };
        self.reported.report(self.source.lidar_stats(), log, outputs);
        let n_bad = self.source.n_bad_clouds();
        if n_bad > self.n_bad_clouds {
            outputs.count("bad_sweeps", n_bad - self.n_bad_clouds);
            self.n_bad_clouds = n_bad;
        }
        let new: Vec<String> = self.source.damage().iter().skip(self.n_damage_reported).cloned().collect();
        self.n_damage_reported += new.len();
        for text in new {
            self.report(text, outputs);
        }
    }

    /// The next sweep to publish; `None` at the end of the drive or of the part to read.
    fn next_sweep(&mut self, outputs: &mut Outputs) -> Result<Option<(Loan<SweepTopic>, SweepInfo)>, StepError> {
        while let Some((loan, sweep)) = sweep::next(&mut self.source, outputs)? {
            let first = *self.at.first.get_or_insert(sweep.stamp.0);
            let seconds = (sweep.stamp.0 - first) as f64 * 1e-9;
            self.at.end = sweep.stamp.0 + i64::from(sweep.duration_nanos);
            if self.settings.end_s > 0.0 && seconds >= self.settings.end_s {
                return Ok(None);
            }
            if seconds < self.settings.start_s {
                self.source.take_fixes();
                continue;
            }
            if sweep.turn < self.settings.min_turn {
                outputs.count("partial_sweeps", 1);
                self.at.n_partial += 1;
                continue;
            }
            self.at.n_sweeps += 1;
            return Ok(Some((loan, sweep)));
        }
        self.at.is_complete = true;
        Ok(None)
    }

    /// Skips measurements of other sensors before the first sweep.
    fn begin(&mut self, begin: i64, outputs: &mut Outputs) {
        self.at.begun = Some(begin);
        let n_early = self.images.skip_before(begin) + self.mosaics.skip_before(begin);
        self.fixes.skip_before(begin);
        let before = self.inertial.take_errors();
        self.inertial.skip_before(begin);
        if n_early > 0 {
            outputs.count("frames_before_sweeps", n_early);
        }
        if before.0 > 0 {
            outputs.count("bad_imu_lines", before.0);
            self.tally.bad_imu_lines += before.0;
        }
    }

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
        let drive = Drive::open(&context.drive).map_err(StepError::data)?;
        let source = drive.sweeps().map_err(StepError::data)?;
        let (fixes, log) = drive.fixes().map_err(StepError::io)?;
        let trigger = Trigger::new(settings.trigger_hz, settings.trigger_m);
        let odometer = Odometer::new(&fixes);
        let (images, skipped_images) = trigger.thin_out(drive.camera_frames(), &odometer);
        let (mosaics, skipped_mosaics) = trigger.thin_out(drive.mosaic_frames(), &odometer);
        let without_height = fixes.iter().filter(|fix| fix.altitude_m.is_none()).count() as u64;
        let n_fixes = fixes.len() as u64;
        let strange_files = drive.strange_files().len() as u64;
        let inertial = Inertial::new(drive.imu().map_err(StepError::io)?);
        Ok(Self {
            settings: settings.clone(),
            source,
            images: Events::new(images, |frame| frame.stamp.0),
            mosaics: Events::new(mosaics, |frame| frame.stamp.0),
            fixes: Events::new(fixes, |fix| fix.stamp.0),
            inertial,
            initial: InitialCounts { skipped_images, skipped_mosaics, strange_files, log, n_fixes, without_height },
            at: Position::default(),
            tally: Tally::default(),
            n_reported: 0,
            n_damage_reported: 0,
            reported: ReportedCounts::default(),
            n_bad_clouds: 0,
            drive,
        })
    }

    /// Publishes the next tick.
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let next = self.next_sweep(outputs)?;
        self.count_losses(outputs);
        let Some((loan, sweep)) = next else {
            if self.at.begun.is_none() {
                // A restart reads the same drive with the same settings.
                return Err(StepError::configuration(self.no_sweep()));
            }
            let n_late = self.images.n_left() + self.mosaics.n_left();
            if n_late > 0 {
                outputs.count("frames_after_sweeps", n_late);
            }
            outputs.set_progress(1.0);
            return Ok(Flow::End);
        };
        if self.at.begun.is_none() {
            self.report_initial(outputs);
            self.begin(sweep.stamp.0, outputs);
        }
        publish_sweep(loan, &sweep, self.drive.model(), outputs)?;
        let end = sweep.stamp.0 + i64::from(sweep.duration_nanos);
        self.publish_others(end, outputs)?;
        outputs.set_drive_time(sweep.stamp.0);
        outputs.set_progress(self.source.progress());
        Ok(Flow::Continue)
    }

    /// Reports the doubts about what was read.
    pub(crate) fn finish(&self, outputs: &mut Outputs) {
        let mut doubts = Doubts { settings: &self.settings, outputs };
        doubts.captures(&self.source.lidar_stats(), self.source.capture_bytes());
        let n_bad_clouds = self.source.n_bad_clouds();
        doubts.files(&self.tally, self.at.n_sweeps + n_bad_clouds, n_bad_clouds);
        if self.drive.manifest().gnss.is_some() {
            let n_fixes = self.initial.n_fixes;
            doubts.log(&self.initial.log, n_fixes - self.initial.without_height, n_fixes);
        } else {
            doubts.log(&self.source.log_stats(), self.tally.gnss_rows, self.tally.fixes);
        }
        let frames = || self.drive.camera_frames().iter().chain(self.drive.mosaic_frames());
        if let Some(first) = self.at.first {
            let is_outside =
                |frame: &&Frame| frame.stamp.0 < first || self.at.is_complete && frame.stamp.0 >= self.at.end;
            doubts.outside(frames().filter(is_outside).count() as u64, frames().count() as u64);
        }
        doubts.silent(&self.silent_sensors());
    }

    /// Cameras without a file, and other sensors without a message.
    fn silent_sensors(&self) -> Vec<String> {
        let manifest = self.drive.manifest();
        let has_none = |frames: &[Frame], camera: usize| !frames.iter().any(|frame| frame.camera == camera);
        let named = |kind: &str, name: &str, folder: &str| format!("{kind} {name} (folder {folder} is empty)");
        let mut sensors = Vec::new();
        for (index, entry) in manifest.cameras.iter().enumerate() {
            if has_none(self.drive.camera_frames(), index) {
                sensors.push(named("camera", &entry.name, &entry.folder));
            }
        }
        for (index, entry) in manifest.mosaics.iter().enumerate() {
            if has_none(self.drive.mosaic_frames(), index) {
                sensors.push(named("mosaic", &entry.name, &entry.folder));
            }
        }
        if self.at.begun.is_some_and(|begun| self.at.end - begun >= MIN_SENSOR_NANOS) {
            let logs = [
                ("gnss", manifest.gnss.is_some(), self.tally.fixes),
                ("imu", manifest.imu.is_some(), self.tally.imu_samples),
            ];
            let silent = logs.iter().filter(|(_, is_named, n)| *is_named && *n == 0);
            sensors.extend(silent.map(|(name, ..)| (*name).to_owned()));
        }
        sensors
    }

    fn no_sweep(&self) -> NoSweepError {
        let Settings { start_s, end_s, .. } = self.settings;
        let part = match (start_s > 0.0, end_s > 0.0) {
            (false, false) => "drive".to_owned(),
            (_, false) => format!("drive from start_s = {start_s} on"),
            _ => format!("drive from start_s = {start_s} to end_s = {end_s}"),
        };
        let stats = self.source.lidar_stats();
        NoSweepError::Recorded {
            part,
            n_partial: self.at.n_partial,
            n_packets: stats.data_packets,
            n_foreign: stats.foreign_packets,
            n_bad: self.source.n_bad_clouds(),
        }
    }

    pub(crate) fn save(&mut self) -> Result<Vec<u8>, StepError> {
        let state = SavedState {
            source: self.source.position(),
            at: self.at,
            tally: self.tally,
            images: self.images.position(),
            mosaics: self.mosaics.position(),
            fixes: self.fixes.position(),
            inertial: self.inertial.position(),
        };
        Ok(encode_state(STATE_VERSION, &state)?)
    }

    pub(crate) fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let state: SavedState = decode_state(STATE_VERSION, state)?;
        let in_drive = self.source.resume(state.source).map_err(StepError::data)?
            & self.images.resume(state.images)
            & self.mosaics.resume(state.mosaics)
            & self.fixes.resume(state.fixes);
        if !in_drive {
            return Err(StepError::data("the saved state belongs to another drive"));
        }
        (self.at, self.tally) = (state.at, state.tally);
        self.inertial.skip_before(state.inertial);
        let log = if self.drive.manifest().gnss.is_some() { LogStats::default() } else { self.source.log_stats() };
        self.reported = ReportedCounts::up_to(self.source.lidar_stats(), log);
        self.n_bad_clouds = self.source.n_bad_clouds();
        Ok(())
    }
}

/// Collects errors of damaged files and returns whether there is one; other errors end the step.
fn keep_file_error(
    result: Result<(), FrameError>,
    counter: &'static str,
    errors: &mut Vec<(&'static str, FrameError)>,
) -> Result<bool, StepError> {
    match result {
        Ok(()) => Ok(false),
        Err(FrameError::Step(error)) => Err(error),
        Err(error) => {
            errors.push((counter, error));
            Ok(true)
        }
    }
}
