//! Sweep by sweep through a recorded drive.

use crate::Settings;
use crate::events::Events;
use crate::frames::{Fault, publish_image, publish_mosaic};
use crate::inertial::Inertial;
use crate::odometer::Odometer;
use crate::publish::{Told, publish_fixes, publish_rows, publish_sweep};
use crate::sweep;
use crate::trigger::Trigger;
use formats::drive::{Drive, DriveSweep, Frame, SourcePosition, SweepSource};
use formats::nmea::{Fix, LogStats};
use messages::{Image, Imu, Message, Mosaic, Sweep};
use serde::{Deserialize, Serialize};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};

/// Raised when the saved state changes its meaning.
const STATE_VERSION: u32 = 2;
/// Damaged files that are named one by one; the counters have them all.
const MAX_NAMED: usize = 10;
/// Receivers speak up to 20 times a second, so this is 200 s after a gap in the sweeps.
const MAX_FIXES: usize = 4096;

/// A drive and how far it has been published.
pub(crate) struct Recorded {
    settings: Settings,
    drive: Drive,
    source: SweepSource,
    images: Events<Frame>,
    mosaics: Events<Frame>,
    fixes: Events<Fix>,
    inertial: Inertial,
    /// What the first tick has to say.
    first_words: FirstWords,
    at: Position,
    /// Damaged files named so far.
    n_named: usize,
    n_damage_named: usize,
    told: Told,
    n_bad_clouds: u64,
}

/// Where the next tick begins, beside the source's own place.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Position {
    /// Stamp of the first sweep of the drive.
    first: Option<i64>,
    /// Whether a sweep was published.
    has_begun: bool,
}

#[derive(Serialize, Deserialize)]
struct SavedState {
    source: SourcePosition,
    at: Position,
    images: u64,
    mosaics: u64,
    fixes: u64,
    inertial: i64,
}

/// Counts that are known before the first tick.
struct FirstWords {
    skipped_images: u64,
    skipped_mosaics: u64,
    strange_files: u64,
    log: LogStats,
    without_height: u64,
}

impl Recorded {
    /// Everything of the other sensors up to the end of the sweep.
    fn publish_others(&mut self, end: i64, outputs: &mut Outputs) -> Result<(), StepError> {
        let manifest = self.drive.manifest();
        let mut faults = Vec::new();
        for frame in self.images.take_before(end, Image::QUEUE) {
            let Some(entry) = manifest.cameras.get(frame.camera) else { continue };
            keep_file_fault(publish_image(frame, entry, outputs), "bad_images", &mut faults)?;
        }
        for frame in self.mosaics.take_before(end, Mosaic::QUEUE) {
            let Some(entry) = manifest.mosaics.get(frame.camera) else { continue };
            keep_file_fault(publish_mosaic(frame, entry, outputs), "bad_mosaics", &mut faults)?;
        }
        let of_packets = self.source.take_fixes();
        if manifest.gnss.is_some() {
            publish_fixes(self.fixes.take_before(end, MAX_FIXES), outputs)?;
        } else {
            publish_fixes(&of_packets, outputs)?;
        }
        let samples = self.inertial.take_before(end);
        publish_rows::<Imu>(&samples, samples.first().map(|row| row.stamp), outputs)?;
        let (n_bad, fault) = self.inertial.take_faults();
        if n_bad > 0 {
            outputs.count("bad_imu_lines", n_bad);
        }
        for (counter, text) in faults {
            outputs.count(counter, 1);
            self.name(text, outputs);
        }
        if let Some(text) = fault {
            self.name(format!("imu: {text}"), outputs);
        }
        Ok(())
    }

    /// Tells the operator of a damaged file, unless there are too many.
    fn name(&mut self, text: String, outputs: &mut Outputs) {
        match self.n_named {
            n if n < MAX_NAMED => outputs.note(text),
            MAX_NAMED => outputs.note("more files are damaged; the counters have them all"),
            _ => {}
        }
        self.n_named += 1;
    }

    fn say_first_words(&mut self, outputs: &mut Outputs) {
        let words = &self.first_words;
        for (name, n) in [
            ("images_skipped_by_trigger", words.skipped_images),
            ("mosaics_skipped_by_trigger", words.skipped_mosaics),
            ("strange_files", words.strange_files),
            ("bad_nmea_lines", words.log.bad_lines),
            ("gnss_without_fix", words.log.without_fix),
            ("gnss_out_of_order", words.log.out_of_order),
            ("gnss_without_height", words.without_height),
        ] {
            if n > 0 {
                outputs.count(name, n);
            }
        }
        if self.drive.is_inferred() {
            let (model, format) = (self.drive.model().name(), &self.drive.manifest().lidar.format);
            outputs.note(format!(
                "the drive has no drive.toml: taken as {format} sweeps of one {model} without other sensors"
            ));
        }
        if let Some(path) = self.drive.strange_files().first() {
            outputs.note(format!("{}: the name is no stamp in ns; such files are left out", path.display()));
        }
    }

    /// Adds what has been lost or damaged since the last call.
    fn count_losses(&mut self, outputs: &mut Outputs) {
        // Where the drive has a log of its own, the packets' sentences are not used.
        let log = if self.drive.manifest().gnss.is_some() { LogStats::default() } else { self.source.log_stats() };
        self.told.tell(self.source.lidar_stats(), log, outputs);
        let n_bad = self.source.n_bad_clouds();
        if n_bad > self.n_bad_clouds {
            outputs.count("bad_sweeps", n_bad - self.n_bad_clouds);
            self.n_bad_clouds = n_bad;
        }
        let new: Vec<String> = self.source.damage().iter().skip(self.n_damage_named).cloned().collect();
        self.n_damage_named += new.len();
        for text in new {
            self.name(text, outputs);
        }
    }

    /// The next sweep that is to be published; `None` at the end of the drive or of its part.
    fn next_sweep(&mut self, outputs: &mut Outputs) -> Result<Option<(Loan<Sweep>, DriveSweep)>, StepError> {
        while let Some((loan, sweep)) = sweep::next(&mut self.source, outputs)? {
            let first = *self.at.first.get_or_insert(sweep.stamp.0);
            let seconds = (sweep.stamp.0 - first) as f64 * 1e-9;
            if self.settings.end_s > 0.0 && seconds >= self.settings.end_s {
                return Ok(None);
            }
            if seconds < self.settings.start_s {
                self.source.take_fixes();
                continue;
            }
            if sweep.turn < self.settings.min_turn {
                outputs.count("partial_sweeps", 1);
                continue;
            }
            return Ok(Some((loan, sweep)));
        }
        Ok(None)
    }

    /// Other sensors may have run before; what they measured then belongs to no sweep.
    fn begin(&mut self, begin: i64, outputs: &mut Outputs) {
        self.at.has_begun = true;
        let n_early = self.images.skip_before(begin) + self.mosaics.skip_before(begin);
        self.fixes.skip_before(begin);
        let before = self.inertial.take_faults();
        self.inertial.skip_before(begin);
        if n_early > 0 {
            outputs.count("frames_before_sweeps", n_early);
        }
        if before.0 > 0 {
            outputs.count("bad_imu_lines", before.0);
        }
    }

    /// What the drive and the part of it that is read have wrong.
    pub(crate) fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let mut problems = Vec::new();
        if settings.end_s > 0.0 && settings.end_s <= settings.start_s {
            let text = format!("value {} must be after start_s = {}, or 0", settings.end_s, settings.start_s);
            problems.push(Problem::of_key("end_s", text));
        }
        // A drive that is not there yet may be about to be made; whether it will be is the supervisor's to say.
        if context.drive.exists()
            && let Err(error) = Drive::open(&context.drive)
        {
            problems.extend(error.problems.iter().map(|problem| Problem::of_key("", problem.to_string())));
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
        let strange_files = drive.strange_files().len() as u64;
        let inertial = Inertial::new(drive.imu().map_err(StepError::io)?);
        Ok(Self {
            settings: settings.clone(),
            source,
            images: Events::new(images, |frame| frame.stamp.0),
            mosaics: Events::new(mosaics, |frame| frame.stamp.0),
            fixes: Events::new(fixes, |fix| fix.stamp.0),
            inertial,
            first_words: FirstWords { skipped_images, skipped_mosaics, strange_files, log, without_height },
            at: Position::default(),
            n_named: 0,
            n_damage_named: 0,
            told: Told::default(),
            n_bad_clouds: 0,
            drive,
        })
    }

    /// The next tick.
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let next = self.next_sweep(outputs)?;
        self.count_losses(outputs);
        let Some((loan, sweep)) = next else {
            let n_late = self.images.n_left() + self.mosaics.n_left();
            if n_late > 0 {
                outputs.count("frames_after_sweeps", n_late);
            }
            outputs.set_progress(1.0);
            return Ok(Flow::End);
        };
        if !self.at.has_begun {
            self.say_first_words(outputs);
            self.begin(sweep.stamp.0, outputs);
        }
        publish_sweep(loan, &sweep, self.drive.model(), outputs)?;
        let end = sweep.stamp.0 + i64::from(sweep.duration_nanos);
        self.publish_others(end, outputs)?;
        outputs.set_drive_time(sweep.stamp.0);
        outputs.set_progress(self.source.progress());
        Ok(Flow::Continue)
    }

    pub(crate) fn save(&mut self) -> Result<Vec<u8>, StepError> {
        let state = SavedState {
            source: self.source.position(),
            at: self.at,
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
            return Err(StepError::data("the saved state is of another drive"));
        }
        self.at = state.at;
        self.inertial.skip_before(state.inertial);
        let log = if self.drive.manifest().gnss.is_some() { LogStats::default() } else { self.source.log_stats() };
        self.told = Told::up_to(self.source.lidar_stats(), log);
        self.n_bad_clouds = self.source.n_bad_clouds();
        Ok(())
    }
}

/// Puts a damaged file beside; other faults end the step.
fn keep_file_fault(
    done: Result<(), Fault>,
    counter: &'static str,
    faults: &mut Vec<(&'static str, String)>,
) -> Result<(), StepError> {
    match done {
        Ok(()) => Ok(()),
        Err(Fault::File(text)) => {
            faults.push((counter, text));
            Ok(())
        }
        Err(Fault::Step(error)) => Err(error),
    }
}
