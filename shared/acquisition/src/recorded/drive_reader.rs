//! A recorded drive, and the position up to which it has been read.

use super::events::Events;
use super::inertial::{BadLines, Inertial};
use super::odometer::Odometer;
use super::secondary_lidars::{SecondaryLidars, SecondaryNews, SecondaryPosition};
use super::trigger::{ThinnedFrames, Trigger};
use crate::doubts::Doubts;
use crate::error::{DriveError, NoSweepError};
use crate::rows::StampedHeader;
use drive::manifest::Manifest;
use drive::{Drive, DriveLidar, Frame, SourcePosition, SweepInfo, SweepSource};
use lidar::nmea::{Fix, LogStats};
use lidar::{OtherModel, SweepError, SweepPoint};
use messages::{ImageTopic, ImuRow, Message, MosaicTopic};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::Path;

/// Shortest part in which a sensor must have data. A shorter part of a drive may lie between two fixes.
const MIN_SENSOR_NANOS: i64 = 2_000_000_000;
/// Largest number of fixes per tick: 200 s of a receiver at 20 Hz, after a gap in the sweeps.
const MAX_FIXES: usize = 4096;

/// The part of a drive to read.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Start, s after the first sweep.
    pub start_s: f64,
    /// End, s after the first sweep; 0 = the end of the drive.
    pub end_s: f64,
    /// Least share of a revolution, 0 to 1. Smaller sweeps are skipped.
    pub min_turn: f64,
}

/// A drive and the position up to which it has been read.
pub struct DriveReader {
    part: Part,
    drive: Drive,
    source: SweepSource,
    secondary_lidars: SecondaryLidars,
    images: Events<Frame>,
    mosaics: Events<Frame>,
    fixes: Events<Fix>,
    inertial: Inertial,
    initial: InitialCounts,
    at: Progress,
}

/// Start of the next tick, in addition to the source's own position.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Progress {
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

/// A position between two ticks.
#[derive(Serialize, Deserialize)]
pub struct DrivePosition {
    source: SourcePosition,
    secondary_lidars: Vec<SecondaryPosition>,
    at: Progress,
    images: u64,
    mosaics: u64,
    fixes: u64,
    inertial: i64,
}

/// Counts that are known before the first tick.
#[derive(Clone, Debug)]
pub struct InitialCounts {
    /// Images that do not pass the trigger rule.
    pub skipped_images: u64,
    /// Mosaics that do not pass the trigger rule.
    pub skipped_mosaics: u64,
    /// Files whose name is not a stamp.
    pub strange_files: u64,
    /// Sentences of the GNSS receiver.
    pub log: LogStats,
    /// Fixes of the GNSS receiver.
    pub n_fixes: u64,
    /// Fixes without a height.
    pub without_height: u64,
}

/// Result of [`DriveReader::next_sweep`].
pub enum NextSweep {
    /// A sweep of the part to read.
    Sweep(SweepInfo),
    /// A sweep before the part to read; its points must be discarded.
    Early,
    /// A sweep of less than the least share of a revolution; its points must be discarded.
    Partial,
    /// The end of the drive or of the part to read.
    End,
}

/// Measurements before the first sweep.
pub struct SkippedAtBegin {
    /// Images and mosaics.
    pub frames: u64,
    /// Damaged lines of the IMU.
    pub bad_imu_lines: BadLines,
}

/// Measurements of the other sensors up to the end of a sweep.
pub struct Due<'a> {
    /// The manifest of the drive.
    pub manifest: &'a Manifest,
    /// Image files.
    pub images: &'a [Frame],
    /// Mosaic files.
    pub mosaics: &'a [Frame],
    /// Fixes of the receiver's log or, without a log, of the LiDAR's position packets.
    pub fixes: Cow<'a, [Fix]>,
    /// Samples of the IMU.
    pub samples: Vec<ImuRow>,
    /// Damaged lines of the IMU.
    pub bad_imu_lines: BadLines,
}

/// Reasons why a drive cannot be read, found before the run starts. A missing folder may be simulated first; the
/// supervisor checks this.
pub fn drive_problems(folder: &Path) -> Vec<String> {
    if !folder.exists() {
        return Vec::new();
    }
    match Drive::open(folder) {
        Ok(drive) => drive.lidars().enumerate().filter_map(|(index, lidar)| wrong_captures(lidar, index)).collect(),
        Err(error) => error.problems.iter().map(ToString::to_string).collect(),
    }
}

/// Reason why no sweep can be read from the captures of a drive, found from their first packets, before the run starts.
fn wrong_captures(lidar: &DriveLidar, index: usize) -> Option<String> {
    if lidar.format != "pcap" || lidar.files.is_empty() {
        return None;
    }
    match OtherModel::find(&lidar.files, &lidar.lidar) {
        Ok(Some(other)) => Some(other.to_string()),
        Ok(None) => match SweepSource::open(lidar) {
            // Without a secondary LiDAR, the drive still has ticks.
            Err(SweepError::NoSensor { .. }) if index > 0 => None,
            opened => opened.err().map(|error| error.to_string()),
        },
        Err(error) => Some(error.to_string()),
    }
}

impl InitialCounts {
    /// Counts with the names of their counters.
    pub fn named(&self) -> [(&'static str, u64); 11] {
        [
            ("images_skipped_by_trigger", self.skipped_images),
            ("mosaics_skipped_by_trigger", self.skipped_mosaics),
            ("strange_files", self.strange_files),
            ("bad_nmea_lines", self.log.bad_lines),
            ("gnss_without_checksum", self.log.without_checksum),
            ("gnss_without_fix", self.log.without_fix),
            ("gnss_at_zero", self.log.null_islands),
            ("gnss_undated", self.log.undated),
            ("gnss_out_of_order", self.log.out_of_order),
            ("gnss_repeated", self.log.repeated),
            ("gnss_without_height", self.without_height),
        ]
    }
}

/// Exposures outside of the sweeps.
#[derive(Clone, Copy, Debug)]
pub struct FramesOutside {
    /// Number of exposures before the first or after the last sweep.
    pub n_outside: u64,
    /// Number of all exposures.
    pub n_all: u64,
}

impl DriveReader {
    /// Opens a drive. The trigger rule thins out its exposures.
    pub fn open(folder: &Path, part: Part, trigger: Trigger) -> Result<Self, DriveError> {
        let drive = Drive::open(folder)?;
        let mut source = drive.sweeps()?;
        let secondary_lidars = SecondaryLidars::open(&drive, &mut source)?;
        let (fixes, log) = drive.fixes().map_err(DriveError::Log)?;
        let odometer = Odometer::new(&fixes);
        let ThinnedFrames { kept: images, n_skipped: skipped_images } =
            trigger.thin_out(drive.camera_frames(), &odometer);
        let ThinnedFrames { kept: mosaics, n_skipped: skipped_mosaics } =
            trigger.thin_out(drive.mosaic_frames(), &odometer);
        let without_height = fixes.iter().filter(|fix| fix.altitude_m.is_none()).count() as u64;
        let n_fixes = fixes.len() as u64;
        let strange_files = drive.strange_files().len() as u64;
        let inertial = Inertial::new(drive.imu().map_err(DriveError::Log)?);
        Ok(Self {
            part,
            source,
            secondary_lidars,
            images: Events::new(images, |frame| frame.stamp.0),
            mosaics: Events::new(mosaics, |frame| frame.stamp.0),
            fixes: Events::new(fixes, |fix| fix.stamp.0),
            inertial,
            initial: InitialCounts { skipped_images, skipped_mosaics, strange_files, log, n_fixes, without_height },
            at: Progress::default(),
            drive,
        })
    }

    /// Passes the points of the next sweep to `sink`, in pieces.
    pub fn next_sweep(&mut self, sink: impl FnMut(&[SweepPoint])) -> Result<NextSweep, SweepError> {
        let Some(sweep) = self.source.next_sweep(sink)? else {
            self.at.is_complete = true;
            return Ok(NextSweep::End);
        };
        let first = *self.at.first.get_or_insert(sweep.stamp.0);
        let seconds = (sweep.stamp.0 - first) as f64 * 1e-9;
        self.at.end = sweep.stamp.0 + i64::from(sweep.duration_nanos);
        if self.part.end_s > 0.0 && seconds >= self.part.end_s {
            return Ok(NextSweep::End);
        }
        if seconds < self.part.start_s {
            self.source.take_fixes();
            return Ok(NextSweep::Early);
        }
        if sweep.turn < self.part.min_turn {
            self.at.n_partial += 1;
            return Ok(NextSweep::Partial);
        }
        self.at.n_sweeps += 1;
        Ok(NextSweep::Sweep(sweep))
    }

    /// Number of secondary LiDARs.
    pub fn n_secondary_lidars(&self) -> usize {
        self.secondary_lidars.len()
    }

    /// Passes the points of a secondary LiDAR during `sweep`, which [`DriveReader::next_sweep`] returned last, to
    /// `sink`. `None` without points. `index` counts from the first secondary LiDAR.
    pub fn next_sweep_of_secondary(
        &mut self,
        index: usize,
        sweep: &SweepInfo,
        sink: impl FnMut(&[SweepPoint]),
    ) -> Result<Option<StampedHeader>, SweepError> {
        self.secondary_lidars.next_sweep(index, sweep, sink)
    }

    /// News of the secondary LiDARs since the last call.
    pub(super) fn take_news_of_secondary_lidars(&mut self) -> SecondaryNews {
        self.secondary_lidars.take_news()
    }

    /// Collects the doubts about the secondary LiDARs.
    pub(super) fn doubt_secondary_lidars(&self, doubts: &mut Doubts) {
        self.secondary_lidars.doubt(doubts);
    }

    /// Skips measurements of other sensors before the first sweep.
    pub fn begin(&mut self, begin: i64) -> SkippedAtBegin {
        self.at.begun = Some(begin);
        let frames = self.images.skip_before(begin) + self.mosaics.skip_before(begin);
        self.fixes.skip_before(begin);
        SkippedAtBegin { frames, bad_imu_lines: self.inertial.skip_before(begin) }
    }

    /// Whether [`DriveReader::begin`] was called.
    pub fn has_begun(&self) -> bool {
        self.at.begun.is_some()
    }

    /// Takes the measurements of the other sensors before `end`, up to the limits of one tick.
    pub fn take_before(&mut self, end: i64) -> Due<'_> {
        let manifest = self.drive.manifest();
        let of_packets = self.source.take_fixes();
        let of_log = self.fixes.take_before(end, MAX_FIXES);
        Due {
            manifest,
            images: self.images.take_before(end, ImageTopic::QUEUE),
            mosaics: self.mosaics.take_before(end, MosaicTopic::QUEUE),
            fixes: if manifest.gnss.is_some() { of_log.into() } else { of_packets.into() },
            samples: self.inertial.take_before(end),
            bad_imu_lines: self.inertial.take_errors(),
        }
    }

    /// Exposures that no tick has taken.
    pub fn n_frames_left(&self) -> u64 {
        self.images.n_left() + self.mosaics.n_left()
    }

    /// Exposures before the first or after the last sweep. `None` without a sweep.
    pub fn frames_outside(&self) -> Option<FramesOutside> {
        let frames = || self.drive.camera_frames().iter().chain(self.drive.mosaic_frames());
        let first = self.at.first?;
        let is_outside = |frame: &&Frame| frame.stamp.0 < first || self.at.is_complete && frame.stamp.0 >= self.at.end;
        Some(FramesOutside { n_outside: frames().filter(is_outside).count() as u64, n_all: frames().count() as u64 })
    }

    /// LiDARs without points, cameras without a file, and other sensors without a message. `n_fixes` and `n_samples`
    /// were read.
    pub fn silent_sensors(&self, n_fixes: u64, n_samples: u64) -> Vec<String> {
        let manifest = self.drive.manifest();
        let has_none = |frames: &[Frame], camera: usize| !frames.iter().any(|frame| frame.camera == camera);
        let named = |kind: &str, name: &str, folder: &str| format!("{kind} {name} (folder {folder} is empty)");
        let mut sensors: Vec<String> = self.secondary_lidars.silent().collect();
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
            let logs = [("gnss", manifest.gnss.is_some(), n_fixes), ("imu", manifest.imu.is_some(), n_samples)];
            let silent = logs.iter().filter(|(_, is_named, n)| *is_named && *n == 0);
            sensors.extend(silent.map(|(name, ..)| (*name).to_owned()));
        }
        sensors
    }

    /// The error of a drive in which no sweep was found.
    pub fn no_sweep(&self) -> NoSweepError {
        let Part { start_s, end_s, .. } = self.part;
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

    /// The drive.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The sweeps of the drive, with their counters.
    pub fn source(&self) -> &SweepSource {
        &self.source
    }

    /// Sentence counters of the position packets. If the drive has a log of a receiver, the sentences in the packets are not used.
    pub fn packet_log_stats(&self) -> LogStats {
        if self.drive.manifest().gnss.is_some() { LogStats::default() } else { self.source.log_stats() }
    }

    /// Counts that are known before the first tick.
    pub fn initial_counts(&self) -> &InitialCounts {
        &self.initial
    }

    /// Sweeps read so far.
    pub fn n_sweeps(&self) -> u64 {
        self.at.n_sweeps
    }

    /// Position of the next tick.
    pub fn position(&self) -> DrivePosition {
        DrivePosition {
            source: self.source.position(),
            secondary_lidars: self.secondary_lidars.position(),
            at: self.at,
            images: self.images.position(),
            mosaics: self.mosaics.position(),
            fixes: self.fixes.position(),
            inertial: self.inertial.position(),
        }
    }

    /// Continues at a position of the same drive.
    pub fn resume(&mut self, position: DrivePosition) -> Result<(), DriveError> {
        let in_drive = self.source.resume(position.source)?
            & self.images.resume(position.images)
            & self.mosaics.resume(position.mosaics)
            & self.fixes.resume(position.fixes);
        if !in_drive {
            return Err(DriveError::OtherDrive);
        }
        self.secondary_lidars.resume(position.secondary_lidars)?;
        self.at = position.at;
        if self.has_begun() {
            // The bad lines up to this sample were counted before the state was saved.
            self.inertial.skip_before(position.inertial);
            self.inertial.take_errors();
        }
        Ok(())
    }
}
