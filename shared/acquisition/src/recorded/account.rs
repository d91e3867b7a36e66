//! Published and lost data of a recorded drive, for the summary of the run.

use super::secondary_lidars::SecondaryNews;
use super::{BadLines, CameraFileError, DrivePosition, DriveReader, Due, SkippedAtBegin};
use crate::counters::ReportedCounts;
use crate::doubts::{Doubts, Tally};
use crate::error::DriveError;
use formats::cloud_fields::CloudForm;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Damaged files that are reported one by one; the counters include all of them.
const MAX_REPORTED: usize = 10;

/// Counters and notes that have not been reported yet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct News {
    /// Names and numbers.
    pub counts: Vec<(Cow<'static, str>, u64)>,
    /// Texts for the operator.
    pub notes: Vec<String>,
}

/// Published data of a drive, and its losses that have been reported.
#[derive(Default)]
pub struct DriveAccount {
    /// Published data.
    pub tally: Tally,
    /// Damaged files reported so far.
    n_reported: usize,
    n_damage_reported: usize,
    reported: ReportedCounts,
    n_bad_clouds: u64,
    news: News,
}

/// The saved state of a drive that is being read.
#[derive(Serialize, Deserialize)]
pub struct SavedDrive {
    position: DrivePosition,
    tally: Tally,
}

impl News {
    /// The account before the first tick.
    pub fn initial(reader: &DriveReader) -> Self {
        let drive = reader.drive();
        let mut news = Self { counts: named(reader.initial_counts().named()), notes: Vec::new() };
        if drive.is_inferred() {
            let model = drive.model().name();
            let format = &drive.manifest().lidar.format;
            news.notes.push(format!("no drive.toml: reading {format} sweeps of one {model} without other sensors"));
        }
        news.notes.extend(reader.source().form().into_iter().flat_map(CloudForm::changes));
        if let Some(path) = drive.strange_files().first() {
            let path = path.display();
            news.notes.push(format!("{path}: the file name is not a stamp in ns; such files are skipped"));
        }
        let log = &reader.initial_counts().log;
        if let Some(first) = &log.first_bad {
            news.notes.push(format!("{} NMEA lines are damaged or impossible; the first: {first}", log.bad_lines));
        }
        if log.without_checksum > 0 {
            let n = log.without_checksum;
            news.notes.push(format!("{n} NMEA sentences have no checksum: damage in them may be unnoticed"));
        }
        if log.null_islands > 0 {
            news.notes
                .push(format!("{} GNSS fixes at 0 0 are skipped: the receiver had no position", log.null_islands));
        }
        news
    }
}

impl DriveAccount {
    /// The state of the drive between two ticks.
    pub fn save(&self, reader: &DriveReader) -> SavedDrive {
        SavedDrive { position: reader.position(), tally: self.tally }
    }

    /// Continues both the reader and its account at a saved state.
    pub fn resumed(saved: SavedDrive, reader: &mut DriveReader) -> Result<Self, DriveError> {
        reader.resume(saved.position)?;
        let source = reader.source();
        let reported = ReportedCounts::up_to(source.lidar_stats(), reader.packet_log_stats());
        Ok(Self { tally: saved.tally, reported, n_bad_clouds: source.n_bad_clouds(), ..Self::default() })
    }

    /// Counters and notes since the last call.
    pub fn take_news(&mut self) -> News {
        std::mem::take(&mut self.news)
    }

    /// Adds packets and files that were lost or damaged since the last call.
    pub fn add_losses(&mut self, reader: &mut DriveReader) {
        let SecondaryNews { counts, damage } = reader.take_news_of_secondary_lidars();
        self.news.counts.extend(counts.into_iter().map(|(name, n)| (name.into(), n)));
        for text in damage {
            self.note_damage(text);
        }
        let source = reader.source();
        self.news.counts.extend(named(self.reported.take_new(source.lidar_stats(), reader.packet_log_stats())));
        let n_bad = source.n_bad_clouds();
        if n_bad > self.n_bad_clouds {
            self.news.counts.push(("bad_sweeps".into(), n_bad - self.n_bad_clouds));
            self.n_bad_clouds = n_bad;
        }
        let new: Vec<String> = source.damage().iter().skip(self.n_damage_reported).cloned().collect();
        self.n_damage_reported += new.len();
        for text in new {
            self.note_damage(text);
        }
    }

    /// Adds the data that a tick published: fixes with a height, and damaged camera files with the names of their
    /// counters.
    pub fn add_published(&mut self, due: &Due<'_>, n_gnss_rows: u64, damaged: Vec<(&'static str, CameraFileError)>) {
        self.tally.fixes += due.fixes.len() as u64;
        self.tally.gnss_rows += n_gnss_rows;
        self.tally.imu_samples += due.samples.len() as u64;
        self.tally.bad_imu_lines += due.bad_imu_lines.n;
        for (counter, error) in damaged {
            self.news.counts.push((counter.into(), 1));
            self.note_damage(error.to_string());
        }
        self.add_bad_imu_lines(&due.bad_imu_lines);
    }

    /// Adds the data that was skipped before the first sweep. It is reported, but causes no doubt about the drive.
    pub fn add_skipped(&mut self, skipped: &SkippedAtBegin) {
        self.news.counts.push(("frames_before_sweeps".into(), skipped.frames));
        self.add_bad_imu_lines(&skipped.bad_imu_lines);
    }

    fn add_bad_imu_lines(&mut self, bad: &BadLines) {
        self.news.counts.push(("bad_imu_lines".into(), bad.n));
        if let Some(error) = &bad.first {
            self.note_damage(format!("imu: {error}"));
        }
    }

    /// Reports a damaged file, unless there were too many.
    fn note_damage(&mut self, text: String) {
        match self.n_reported {
            n if n < MAX_REPORTED => self.news.notes.push(text),
            MAX_REPORTED => self.news.notes.push("more files are damaged; see the counters".to_owned()),
            _ => {}
        }
        self.n_reported += 1;
    }

    /// Collects the doubts about the data that was read.
    pub fn doubt(&self, reader: &DriveReader, doubts: &mut Doubts) {
        let source = reader.source();
        let initial = reader.initial_counts();
        let tally = &self.tally;
        doubts.captures(&source.lidar_stats(), source.capture_bytes());
        if let Some(first) = reader.drive().lidars().next() {
            doubts.numbers(&first.missing);
        }
        source.form().into_iter().for_each(|form| doubts.clouds(form));
        let manifest = reader.drive().manifest();
        let has_cameras = !manifest.cameras.is_empty() || !manifest.mosaics.is_empty();
        let has_others = has_cameras || manifest.imu.is_some() || tally.fixes > 0 || reader.n_secondary_lidars() > 0;
        doubts.clock(&source.lidar_stats(), has_others);
        reader.doubt_secondary_lidars(doubts);
        let n_bad_clouds = source.n_bad_clouds();
        doubts.files(tally, reader.n_sweeps() + n_bad_clouds, n_bad_clouds);
        if reader.drive().manifest().gnss.is_some() {
            doubts.log(&initial.log, initial.n_fixes - initial.without_height, initial.n_fixes);
        } else {
            doubts.log(&source.log_stats(), tally.gnss_rows, tally.fixes);
        }
        if let Some(frames) = reader.frames_outside() {
            doubts.outside(frames.n_outside, frames.n_all);
        }
        doubts.silent(&reader.silent_sensors(tally.fixes, tally.imu_samples));
    }
}

fn named(counts: impl IntoIterator<Item = (&'static str, u64)>) -> Vec<(Cow<'static, str>, u64)> {
    counts.into_iter().map(|(name, n)| (name.into(), n)).collect()
}
