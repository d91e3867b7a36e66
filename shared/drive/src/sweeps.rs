//! The sweeps of a drive, from captures or from cloud files.

use super::DriveLidar;
use super::cloud_reader::{CloudFault, CloudReader, CloudReturns};
use formats::cloud_fields::{CloudForm, sampled};
use geometry::Stamp;
use lidar::nmea::{Fix, LogStats};
use lidar::{LidarStats, SweepError, SweepInfo, SweepPoint, SweepPosition, SweepReader};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Longest sweep, ns: sensors turn at 5 Hz or faster.
const LONGEST_NANOS: i64 = 500_000_000;
/// Times of points may pass the start of the next sweep by this part of the duration: the speed of motors varies.
const MARGIN: u32 = 10;

/// Reads sweeps in order, one at a time.
#[derive(Debug)]
pub enum SweepSource {
    /// Sweeps from captures.
    Packets {
        /// Reader of the captures.
        reader: Box<SweepReader>,
        /// Sizes of the captures, for the progress, bytes.
        sizes: Vec<u64>,
    },
    /// Sweeps from cloud files.
    Clouds(Box<Clouds>),
}

/// Reader of sweeps stored as one cloud file each.
#[derive(Debug)]
pub struct Clouds {
    files: Vec<PathBuf>,
    pub(super) stamps: Vec<Stamp>,
    reader: CloudReader,
    pub(super) next: usize,
    /// Points of the next file that earlier slices have taken.
    pub(super) taken: usize,
    /// The next file, if a slice has taken a part of it.
    pub(super) current: Option<CloudReturns>,
    n_bad: u64,
    /// Errors of unreadable files.
    damage: Vec<String>,
}

/// A position between two sweeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SourcePosition {
    /// Position in captures.
    Packets(Box<SweepPosition>),
    /// Position in cloud files.
    Clouds {
        /// Index of the next file.
        next: u64,
        /// Points of this file that earlier slices have taken.
        taken: u64,
        /// Unreadable files so far.
        n_bad: u64,
    },
}

impl SweepSource {
    /// A reader of the sweeps of a LiDAR, at the first.
    pub fn open(of: &DriveLidar) -> Result<Self, SweepError> {
        let DriveLidar { lidar, format, files, stamps, .. } = of.clone();
        if format == "pcap" {
            let size = |path: &PathBuf| path.metadata().map_or(0, |metadata| metadata.len());
            let sizes = files.iter().map(size).collect();
            let reader = Box::new(SweepReader::open(files, Some(&lidar))?);
            return Ok(Self::Packets { reader, sizes });
        }
        let reader = CloudReader::open(of);
        let shift_nanos = reader.form().shift_nanos();
        let stamps = stamps.into_iter().map(|stamp| stamp.plus_nanos(shift_nanos)).collect();
        Ok(Self::Clouds(Box::new(Clouds {
            files,
            stamps,
            reader,
            next: 0,
            taken: 0,
            current: None,
            n_bad: 0,
            damage: Vec::new(),
        })))
    }

    /// Passes the returns of the next sweep to `sink` in firing order, in pieces, at most [`SweepReader::MAX_RETURNS`] in all. `None`
    /// at the end of the drive.
    pub fn next_sweep(&mut self, mut sink: impl FnMut(&[SweepPoint])) -> Result<Option<SweepInfo>, SweepError> {
        match self {
            Self::Packets { reader, .. } => reader.next_sweep(sink),
            Self::Clouds(clouds) => Ok(clouds.next().map(|loaded| {
                sink(&loaded.cloud.returns);
                loaded.sweep
            })),
        }
    }

    /// Position of the next sweep.
    pub fn position(&self) -> SourcePosition {
        match self {
            Self::Packets { reader, .. } => SourcePosition::Packets(Box::new(reader.position())),
            Self::Clouds(clouds) => {
                SourcePosition::Clouds { next: clouds.next as u64, taken: clouds.taken as u64, n_bad: clouds.n_bad }
            }
        }
    }

    /// Continues at a position that [`SweepSource::position`] returned for the same drive. `false` if it belongs to another drive.
    pub fn resume(&mut self, position: SourcePosition) -> Result<bool, SweepError> {
        match (self, position) {
            (Self::Packets { reader, .. }, SourcePosition::Packets(position)) => {
                reader.resume(&position).map(|()| true)
            }
            (Self::Clouds(clouds), SourcePosition::Clouds { next, taken, n_bad })
                if next as usize <= clouds.files.len() =>
            {
                clouds.next = next as usize;
                clouds.taken = taken as usize;
                clouds.n_bad = n_bad;
                clouds.current = None;
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    /// Part of the drive that was read, 0 to 1.
    pub fn progress(&self) -> f64 {
        match self {
            Self::Packets { reader, sizes } => {
                let (file, offset) = reader.place();
                let read = sizes.iter().take(file).sum::<u64>() + offset;
                read as f64 / sizes.iter().sum::<u64>().max(1) as f64
            }
            Self::Clouds(clouds) => clouds.next as f64 / clouds.files.len().max(1) as f64,
        }
    }

    /// Size of all captures, bytes; 0 for cloud files.
    pub fn capture_bytes(&self) -> u64 {
        match self {
            Self::Packets { sizes, .. } => sizes.iter().sum(),
            Self::Clouds(_) => 0,
        }
    }

    /// Packet counters since the start of the drive; zero for cloud files.
    pub fn lidar_stats(&self) -> LidarStats {
        match self {
            Self::Packets { reader, .. } => reader.stats(),
            Self::Clouds(_) => LidarStats::default(),
        }
    }

    /// Fixes of the position packets read since the last call; empty for cloud files.
    pub fn take_fixes(&mut self) -> Vec<Fix> {
        match self {
            Self::Packets { reader, .. } => reader.take_fixes(),
            Self::Clouds(_) => Vec::new(),
        }
    }

    /// Sentence counters of the position packets since the start of the drive; zero for cloud files.
    pub fn log_stats(&self) -> LogStats {
        match self {
            Self::Packets { reader, .. } => reader.log_stats(),
            Self::Clouds(_) => LogStats::default(),
        }
    }

    /// Unreadable cloud files that were skipped, since the start of the drive.
    pub fn n_bad_clouds(&self) -> u64 {
        match self {
            Self::Packets { .. } => 0,
            Self::Clouds(clouds) => clouds.n_bad,
        }
    }

    /// Errors of a few evenly spaced cloud files, with the number of files examined. Captures are not examined.
    pub fn sample(&mut self) -> CloudSample {
        match self {
            Self::Packets { .. } => CloudSample::default(),
            Self::Clouds(clouds) => clouds.sample(),
        }
    }

    /// How cloud files are read, if not in the units of the drive folder's page; empty for captures.
    pub fn form(&self) -> Option<&CloudForm> {
        match self {
            Self::Packets { .. } => None,
            Self::Clouds(clouds) => Some(clouds.reader.form()),
        }
    }

    /// Errors of damaged files since this source was opened, one text per file.
    pub fn damage(&self) -> &[String] {
        match self {
            Self::Packets { reader, .. } => reader.damage(),
            Self::Clouds(clouds) => &clouds.damage,
        }
    }
}

/// Result of [`SweepSource::sample`].
#[derive(Clone, Debug, Default)]
pub struct CloudSample {
    /// Files examined.
    pub n_files: usize,
    /// Files without returns.
    pub n_empty: usize,
    /// Errors of unreadable files.
    pub faults: Vec<String>,
}

/// A cloud file.
pub(super) struct LoadedCloud {
    pub(super) cloud: CloudReturns,
    sweep: SweepInfo,
}

impl Clouds {
    fn sample(&mut self) -> CloudSample {
        let (next, n_bad, n_damaged) = (self.next, self.n_bad, self.damage.len());
        let indexes: Vec<usize> = (0..self.files.len()).collect();
        let mut sample = CloudSample::default();
        for index in sampled(&indexes) {
            self.next = *index;
            let n_returns = self.load().map(|loaded| loaded.cloud.returns.len());
            sample.n_files += 1;
            sample.n_empty += usize::from(n_returns == Some(0));
        }
        sample.faults = self.damage.split_off(n_damaged);
        self.next = next;
        self.n_bad = n_bad;
        sample
    }

    fn next(&mut self) -> Option<LoadedCloud> {
        while self.next < self.files.len() {
            let loaded = self.load();
            self.next += 1;
            if loaded.is_some() {
                return loaded;
            }
        }
        None
    }

    /// The next file; `None` if it cannot be read.
    pub(super) fn load(&mut self) -> Option<LoadedCloud> {
        let path = self.files.get(self.next)?;
        let stamp = self.stamps[self.next].plus_nanos(-self.reader.form().shift_nanos());
        let loaded = self.reader.load(path, stamp);
        match loaded.and_then(|found| Ok((self.sweep(self.next, &found)?, found))) {
            Ok((sweep, cloud)) => Some(LoadedCloud { cloud, sweep }),
            Err(fault) => {
                self.n_bad += 1;
                self.damage.push(format!("{}: {fault}", path.display()));
                None
            }
        }
    }

    fn sweep(&self, index: usize, cloud: &CloudReturns) -> Result<SweepInfo, CloudFault> {
        let stamp = self.stamps[index];
        // The last sweep gets the duration of the sweep before it.
        let neighbors = if index + 1 < self.stamps.len() { Some(index) } else { index.checked_sub(1) };
        let duration =
            neighbors.map_or(100_000_000, |first| self.stamps[first + 1].0.saturating_sub(self.stamps[first].0));
        // A pause of the recording is not a slow revolution.
        let duration_nanos = duration.clamp(1, LONGEST_NANOS) as u32;
        let last_nanos = cloud.returns.last().map_or(0, |last| last.offset_nanos);
        // A single sweep has no known duration.
        let limit_nanos = neighbors.map_or(LONGEST_NANOS as u32, |_| duration_nanos + duration_nanos / MARGIN);
        if last_nanos > limit_nanos {
            return Err(CloudFault::Late { found_nanos: last_nanos, next_nanos: duration_nanos });
        }
        Ok(SweepInfo {
            seq: index as u64,
            stamp,
            duration_nanos: duration_nanos.max(last_nanos),
            n_returns: cloud.returns.len(),
            lost_packets: 0,
            turn: 1.0,
            has_times: cloud.has_times,
        })
    }
}
