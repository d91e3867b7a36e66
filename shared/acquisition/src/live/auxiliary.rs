//! Auxiliary sensors (cameras, GNSS receiver and IMU): received, recorded, and matched to sweeps by their stamps, as in
//! a recorded drive.

mod account;
mod frames;
mod logs;
mod references;
mod sources;

pub use frames::DueFrame;
pub use sources::AuxiliarySources;

use super::clocks::Clocks;
use super::recorded_entries::RecordedEntries;
use super::sensor::SensorStats;
use crate::counters::ReportedCounts;
use crate::doubts::Tally;
use crate::error::LiveError;
use crate::recorded::{CameraFileError, Trigger};
use drive::SweepInfo;
use drive::manifest::{CameraEntry, MosaicEntry};
use files::atomic_file::AtomicFile;
use frames::Frames;
use lidar::PacketArrival;
use lidar::nmea::{Fix, LogStats};
use logs::{FixLog, SampleLog, TakenSamples};
use messages::ImuRow;
use references::{AddedReferences, References};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Table of the clocks in the recording.
const CLOCKS_FILE: &str = "clocks.csv";
/// Interval at which the table is written, in case the run is killed.
const CLOCKS_INTERVAL: Duration = Duration::from_secs(10);
/// Name of the first LiDAR among the clocks, and prefix of the names of the other LiDARs.
const LIDAR: &str = "lidar";
/// Damaged files that are reported one by one; the counters include all of them.
const MAX_REPORTED: u64 = 10;

/// Limits of lateness and of clock offsets.
#[derive(Clone, Copy, Debug)]
pub struct AuxiliaryLimits {
    /// Largest time after the end of a sweep at which an image of its time is still published, s.
    pub max_late_s: f64,
    /// Largest offset between the clocks of two sensors, s.
    pub max_clock_offset_s: f64,
}

/// Cameras, GNSS receiver and IMU of a live vehicle.
pub struct AuxiliarySensors {
    folder: PathBuf,
    entries: RecordedEntries,
    limits: AuxiliaryLimits,
    frames: Option<Frames>,
    references: References,
    fixes: Option<FixLog>,
    samples: Option<SampleLog>,
    clocks: Clocks,
    clocks_written: Instant,
    /// Start of the first and end of the last sweep that was published.
    span: Option<[i64; 2]>,
    tally: Tally,
    reported: ReportedCounts,
    counts: Vec<(&'static str, u64)>,
    notes: Vec<String>,
    n_damaged: u64,
}

/// Measurements of logs that belong to the sweeps up to the last one.
#[derive(Debug, Default)]
pub struct DueRows {
    /// Fixes of the receiver's log.
    pub fixes: Vec<Fix>,
    /// Samples of the IMU.
    pub samples: Vec<ImuRow>,
}

/// News of the auxiliary sensors.
pub struct AuxiliaryNews {
    /// Names and numbers.
    pub counts: Vec<(&'static str, u64)>,
    /// Notes for the operator.
    pub notes: Vec<String>,
}

impl AuxiliarySensors {
    /// Starts to receive, and to record in the folder of the recording. The trigger rule thins out the images that are
    /// published.
    pub fn start(
        sources: &AuxiliarySources,
        folder: PathBuf,
        limits: AuxiliaryLimits,
        trigger: Trigger,
    ) -> Result<Self, LiveError> {
        let entries = sources.entries();
        fs::create_dir_all(&folder).map_err(|source| LiveError::File { path: folder.clone(), source })?;
        let mut references = References::default();
        let frames = sources.start_frames(&folder, &entries, trigger, &mut references)?;
        Ok(Self {
            frames,
            references,
            fixes: sources.start_fixes(&folder, entries.gnss.as_ref())?,
            samples: sources.start_samples(&folder, entries.imu.as_ref())?,
            folder,
            entries,
            limits,
            clocks: Clocks::default(),
            clocks_written: Instant::now(),
            span: None,
            tally: Tally::default(),
            reported: ReportedCounts::default(),
            counts: Vec::new(),
            notes: Vec::new(),
            n_damaged: 0,
        })
    }

    /// Entries of the recording's manifest.
    pub fn entries(&self) -> &RecordedEntries {
        &self.entries
    }

    /// Entries of the color cameras.
    pub fn cameras(&self) -> &[CameraEntry] {
        &self.entries.cameras
    }

    /// Entries of the mosaic cameras.
    pub fn mosaics(&self) -> &[MosaicEntry] {
        &self.entries.mosaics
    }

    /// Whether the fixes come from the receiver's own log, so that the LiDAR's position packets are not used.
    pub fn has_receiver(&self) -> bool {
        self.fixes.is_some()
    }

    /// Adds a sweep that was published, and the arrival of one of its packets.
    pub fn add_sweep(&mut self, info: &SweepInfo, arrival: Option<PacketArrival>) {
        let end = info.stamp.0.saturating_add(i64::from(info.duration_nanos));
        let [begin, last] = self.span.unwrap_or([info.stamp.0, end]);
        self.span = Some([begin, last.max(end)]);
        if let Some(PacketArrival { stamp, captured }) = arrival {
            self.clocks.add(LIDAR, stamp, captured);
        }
    }

    /// Adds the arrival of a packet of a secondary LiDAR.
    pub fn add_arrival_of_lidar(&mut self, name: &str, arrival: Option<PacketArrival>) {
        if let Some(PacketArrival { stamp, captured }) = arrival {
            self.clocks.add(&format!("{LIDAR} {name}"), stamp, captured);
        }
    }

    /// Adds fixes of the LiDAR's position packets, for the trigger rule.
    pub fn add_packet_fixes(&mut self, fixes: &[Fix]) {
        if let Some(frames) = &mut self.frames {
            for fix in fixes {
                frames.add_fix(fix);
            }
        }
    }

    /// Reads the data that has arrived. Returns the rows up to the end of the last sweep.
    pub fn take_rows(&mut self) -> Result<DueRows, LiveError> {
        let mut due = DueRows::default();
        if let Some(log) = &mut self.fixes {
            let fixes = log.take_due(self.span, &mut self.clocks)?;
            if let Some(frames) = &mut self.frames {
                for fix in &fixes.new {
                    frames.add_fix(fix);
                }
            }
            due.fixes = fixes.due;
        }
        if let Some(log) = &mut self.samples {
            let TakenSamples { rows: samples, errors: bad } = log.take_due(self.span, &mut self.clocks)?;
            due.samples = samples;
            let n_bad = bad.len() as u64;
            self.tally.imu_samples += due.samples.len() as u64;
            self.tally.bad_imu_lines += n_bad;
            self.count("bad_imu_lines", n_bad);
            for error in bad {
                self.note_damage(format!("imu: {error}"));
            }
        }
        if let Some(frames) = &mut self.frames {
            frames.take_arrived(&mut self.clocks)?;
        }
        Ok(due)
    }

    /// The next image up to the end of the last sweep, oldest first.
    pub fn next_frame(&mut self) -> Option<DueFrame> {
        let max_late = (self.limits.max_late_s * 1e9) as i64;
        self.frames.as_mut()?.next_due(self.span?, max_late)
    }

    /// Adds an image that was published, or whose file is damaged.
    pub fn add_published(&mut self, frame: &DueFrame, error: Option<CameraFileError>) {
        let (tally, counter) = match frame {
            DueFrame::Color(_) => (&mut self.tally.images, "bad_images"),
            DueFrame::Mosaic(_) => (&mut self.tally.mosaics, "bad_mosaics"),
        };
        tally.add(error.is_some());
        if let Some(error) = error {
            self.count(counter, 1);
            self.note_damage(error.to_string());
        }
    }

    /// Adds fixes that were published, those with a height.
    pub fn add_fixes(&mut self, n_fixes: u64, n_with_height: u64) {
        self.tally.fixes += n_fixes;
        self.tally.gnss_rows += n_with_height;
    }

    /// Ends the reception. Waiting data is recorded first.
    pub fn close(&mut self) {
        if let Some(frames) = &mut self.frames {
            frames.close();
        }
        if let Some(log) = &mut self.fixes {
            log.close();
        }
        if let Some(log) = &mut self.samples {
            log.close();
        }
        self.search_references(true);
    }

    /// Counts and reports dark and white frames that were added during the run.
    fn search_references(&mut self, is_end: bool) {
        let AddedReferences { n: n_added, notes } = self.references.added(is_end);
        self.count("references_added", n_added);
        self.notes.extend(notes);
    }

    /// Counters and notes since the last call. `packets`: counters of the LiDAR's packets and of the sentences in them.
    pub fn take_news(&mut self, packets: Option<SensorStats>) -> AuxiliaryNews {
        if let Some(SensorStats { lidar, log }) = packets {
            let log = self.log_stats(log);
            let new = self.reported.take_new(lidar, log);
            self.counts.extend(new);
        }
        if let Some(frames) = &mut self.frames {
            self.counts.extend(frames.take_counts());
        }
        self.search_references(false);
        self.counts.extend(self.fixes.as_mut().into_iter().flat_map(FixLog::take_counts));
        self.counts.extend(self.samples.as_mut().into_iter().flat_map(SampleLog::take_counts));
        AuxiliaryNews { counts: std::mem::take(&mut self.counts), notes: std::mem::take(&mut self.notes) }
    }

    /// Writes the table of clocks into the recording, if it is time.
    pub fn write_clocks(&mut self, is_last: bool) -> Result<(), LiveError> {
        if !is_last && self.clocks_written.elapsed() < CLOCKS_INTERVAL || self.span.is_none() {
            return Ok(());
        }
        self.clocks_written = Instant::now();
        let path = self.folder.join(CLOCKS_FILE);
        let write = || {
            let file = AtomicFile::create(&path)?;
            file.file().write_all(self.clocks.table().as_bytes())?;
            file.commit_unsynced()
        };
        write().map_err(|source| LiveError::File { path: path.clone(), source })
    }

    /// Counters of the sentences that are used: from the receiver's log, else from the position packets.
    fn log_stats(&self, of_packets: LogStats) -> LogStats {
        self.fixes.as_ref().map_or(of_packets, FixLog::stats)
    }

    fn count(&mut self, name: &'static str, n: u64) {
        self.counts.push((name, n));
    }

    fn note_damage(&mut self, text: String) {
        match self.n_damaged {
            n if n < MAX_REPORTED => self.notes.push(text),
            MAX_REPORTED => self.notes.push("more files are damaged; see the counters".to_owned()),
            _ => {}
        }
        self.n_damaged += 1;
    }
}
