//! The sweeps of a drive, whatever they are recorded as.

use super::{Drive, clouds};
use crate::nmea::{Fix, LogStats};
use crate::velodyne::{LidarReturn, LidarStats, Model, SweepError, SweepInfo, SweepPosition, SweepReader};
use geometry::Stamp;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What holds for a whole sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveSweep {
    /// Number of the revolution or file in the drive.
    pub seq: u64,
    /// Of its first shot.
    pub stamp: Stamp,
    /// ns to the end of the revolution.
    pub duration_nanos: u32,
    /// Points.
    pub n_returns: usize,
    /// Data packets missing inside.
    pub lost_packets: u64,
    /// Share of a turn that it covers, 0 to 1.
    pub turn: f64,
    /// Whether its points have times.
    pub has_times: bool,
}

impl From<SweepInfo> for DriveSweep {
    fn from(info: SweepInfo) -> Self {
        Self {
            seq: info.seq,
            stamp: info.stamp,
            duration_nanos: info.duration_nanos,
            n_returns: info.n_returns,
            lost_packets: info.lost_packets,
            turn: info.turn,
            has_times: true,
        }
    }
}

/// Reads sweeps in order, one at a time.
#[derive(Debug)]
pub enum SweepSource {
    /// Out of captures.
    Packets {
        /// Their reader.
        reader: Box<SweepReader>,
        /// Sizes of the captures, for the progress.
        sizes: Vec<u64>,
    },
    /// One file each.
    Clouds(Clouds),
}

/// Sweeps that are one file each.
#[derive(Debug)]
pub struct Clouds {
    files: Vec<PathBuf>,
    stamps: Vec<Stamp>,
    format: String,
    model: Model,
    next: usize,
    n_bad: u64,
    damage: Vec<String>,
}

/// A place between two sweeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SourcePosition {
    /// In captures.
    Packets(Box<SweepPosition>),
    /// In files.
    Clouds {
        /// Number of the next file.
        next: u64,
        /// Files that could not be read.
        n_bad: u64,
    },
}

impl SweepSource {
    pub(super) fn open(drive: &Drive) -> Result<Self, SweepError> {
        let files = drive.sweep_files().to_vec();
        let format = drive.manifest().lidar.format.clone();
        if format == "pcap" {
            let size = |path: &PathBuf| path.metadata().map_or(0, |metadata| metadata.len());
            let sizes = files.iter().map(size).collect();
            let reader = Box::new(SweepReader::open(files, Some(drive.model()))?);
            return Ok(Self::Packets { reader, sizes });
        }
        let (stamps, model) = (drive.sweep_stamps.clone(), drive.model());
        Ok(Self::Clouds(Clouds { files, stamps, format, model, next: 0, n_bad: 0, damage: Vec::new() }))
    }

    /// Hands the returns of the next sweep to `sink`, piece by piece in the order of firing, at most
    /// [`SweepReader::MAX_RETURNS`] in all. `None`: there are no more.
    pub fn next_sweep(&mut self, mut sink: impl FnMut(&[LidarReturn])) -> Result<Option<DriveSweep>, SweepError> {
        match self {
            Self::Packets { reader, .. } => Ok(reader.next_sweep(sink)?.map(DriveSweep::from)),
            Self::Clouds(clouds) => Ok(clouds.next().map(|(returns, sweep)| {
                sink(&returns);
                sweep
            })),
        }
    }

    /// Where the next sweep begins.
    pub fn position(&self) -> SourcePosition {
        match self {
            Self::Packets { reader, .. } => SourcePosition::Packets(Box::new(reader.position())),
            Self::Clouds(clouds) => SourcePosition::Clouds { next: clouds.next as u64, n_bad: clouds.n_bad },
        }
    }

    /// Goes to a place that [`SweepSource::position`] gave for the same drive. `false` if it cannot be of this drive.
    pub fn resume(&mut self, position: SourcePosition) -> Result<bool, SweepError> {
        match (self, position) {
            (Self::Packets { reader, .. }, SourcePosition::Packets(position)) => {
                reader.resume(*position).map(|()| true)
            }
            (Self::Clouds(clouds), SourcePosition::Clouds { next, n_bad }) if next as usize <= clouds.files.len() => {
                (clouds.next, clouds.n_bad) = (next as usize, n_bad);
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    /// Share of the drive that has been read, 0 to 1.
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

    /// Counts of the packets since the start of the drive; zero for clouds.
    pub fn lidar_stats(&self) -> LidarStats {
        match self {
            Self::Packets { reader, .. } => reader.stats(),
            Self::Clouds(_) => LidarStats::default(),
        }
    }

    /// Fixes of the position packets among those of the sweeps read since the last call; none from clouds.
    pub fn take_fixes(&mut self) -> Vec<Fix> {
        match self {
            Self::Packets { reader, .. } => reader.take_fixes(),
            Self::Clouds(_) => Vec::new(),
        }
    }

    /// Counts of the position packets' sentences since the start of the drive; zero for clouds.
    pub fn log_stats(&self) -> LogStats {
        match self {
            Self::Packets { reader, .. } => reader.log_stats(),
            Self::Clouds(_) => LogStats::default(),
        }
    }

    /// Files that could not be read and were left out, since the start of the drive.
    pub fn n_bad_clouds(&self) -> u64 {
        match self {
            Self::Packets { .. } => 0,
            Self::Clouds(clouds) => clouds.n_bad,
        }
    }

    /// What is wrong with damaged files, one text each, since this source was opened.
    pub fn damage(&self) -> &[String] {
        match self {
            Self::Packets { reader, .. } => reader.damage(),
            Self::Clouds(clouds) => &clouds.damage,
        }
    }
}

impl Clouds {
    fn next(&mut self) -> Option<(Vec<LidarReturn>, DriveSweep)> {
        while let Some(path) = self.files.get(self.next) {
            let index = self.next;
            self.next += 1;
            match clouds::load(path, &self.format, self.model) {
                Ok(returns) => {
                    let sweep = self.sweep(index, returns.len());
                    return Some((returns, sweep));
                }
                Err(rule) => {
                    self.n_bad += 1;
                    self.damage.push(format!("{}: {rule}", path.display()));
                }
            }
        }
        None
    }

    fn sweep(&self, index: usize, n_returns: usize) -> DriveSweep {
        let stamp = self.stamps[index];
        // The last one lasts as long as the one before it.
        let neighbors = if index + 1 < self.stamps.len() { Some(index) } else { index.checked_sub(1) };
        let duration = neighbors.map_or(100_000_000, |first| self.stamps[first + 1].0 - self.stamps[first].0);
        DriveSweep {
            seq: index as u64,
            stamp,
            // A pause of the recording is no slow turn.
            duration_nanos: duration.clamp(1, 500_000_000) as u32,
            n_returns,
            lost_packets: 0,
            turn: 1.0,
            has_times: false,
        }
    }
}
