//! The secondary LiDARs of a drive: their returns during each sweep of the first LiDAR.

use crate::counters::ReportedCounts;
use crate::doubts::Doubts;
use crate::error::DriveError;
use crate::rows::StampedHeader;
use crate::secondary_tally::{SecondaryTally, named};
use drive::{Drive, Missing, SourcePosition, SweepInfo, SweepSource};
use lidar::nmea::LogStats;
use lidar::{SweepError, SweepPoint};
use serde::{Deserialize, Serialize};

/// All secondary LiDARs.
#[derive(Default)]
pub(crate) struct SecondaryLidars(Vec<SecondaryLidar>);

struct SecondaryLidar {
    name: String,
    n_rings: usize,
    source: Source,
    reported: ReportedCounts,
    tally: SecondaryTally,
    reported_tally: SecondaryTally,
    n_damage_reported: usize,
    missing: Missing,
}

enum Source {
    Sweeps(SweepSource),
    /// The LiDAR has no data, for this reason.
    Absent(String),
}

/// Position of a secondary LiDAR; `None` without data.
#[derive(Serialize, Deserialize)]
pub(crate) struct SecondaryPosition {
    source: Option<SourcePosition>,
    tally: SecondaryTally,
}

/// News of all secondary LiDARs.
pub(crate) struct SecondaryNews {
    /// Names and numbers of packets and sweeps.
    pub counts: Vec<(String, u64)>,
    /// Errors of damaged files.
    pub damage: Vec<String>,
}

impl SecondaryLidars {
    /// Opens the recordings of all secondary LiDARs. `first` no longer counts their packets.
    pub fn open(drive: &Drive, first: &mut SweepSource) -> Result<Self, DriveError> {
        let of_drive = drive.lidars().enumerate().skip(1);
        let mut lidars = of_drive
            .map(|(index, of_drive)| {
                let source = match SweepSource::open(of_drive) {
                    _ if of_drive.files.is_empty() => Source::Absent("its folder is empty".to_owned()),
                    Ok(source) => Source::Sweeps(source),
                    // The drive has ticks without it.
                    Err(error @ SweepError::NoSensor { .. }) => Source::Absent(error.to_string()),
                    Err(error) => return Err(error.into()),
                };
                Ok(SecondaryLidar {
                    name: drive.manifest().lidar_name(index).into_owned(),
                    n_rings: of_drive.lidar.n_rings(),
                    source,
                    reported: ReportedCounts::default(),
                    tally: SecondaryTally::default(),
                    reported_tally: SecondaryTally::default(),
                    n_damage_reported: 0,
                    missing: of_drive.missing.clone(),
                })
            })
            .collect::<Result<Vec<_>, DriveError>>()?;
        SweepSource::separate(std::iter::once(first).chain(lidars.iter_mut().filter_map(SecondaryLidar::sweeps_mut)));
        Ok(Self(lidars))
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Passes the returns of a LiDAR during a sweep of the first one to `sink`. `None` without returns.
    pub fn next_sweep(
        &mut self,
        index: usize,
        first: &SweepInfo,
        sink: impl FnMut(&[SweepPoint]),
    ) -> Result<Option<StampedHeader>, SweepError> {
        let Some(lidar) = self.0.get_mut(index) else { return Ok(None) };
        let Source::Sweeps(source) = &mut lidar.source else { return Ok(None) };
        let end = first.stamp.0 + i64::from(first.duration_nanos);
        let slice = source.next_slice([first.stamp.0, end], sink)?;
        lidar.tally.bad_sweeps = source.n_bad_clouds();
        Ok(lidar.tally.add(slice, first, index + 1, lidar.n_rings))
    }

    /// News since the last call.
    pub fn take_news(&mut self) -> SecondaryNews {
        let mut counts = Vec::new();
        let mut damage = Vec::new();
        for lidar in &mut self.0 {
            let Source::Sweeps(source) = &lidar.source else { continue };
            let before = std::mem::replace(&mut lidar.reported_tally, lidar.tally);
            let of_packets = lidar.reported.take_new(source.lidar_stats(), LogStats::default());
            counts.extend(named(&lidar.name, lidar.tally.since(&before).into_iter().chain(of_packets)));
            damage.extend(source.damage().iter().skip(lidar.n_damage_reported).cloned());
            lidar.n_damage_reported = source.damage().len();
        }
        SecondaryNews { counts, damage }
    }

    /// LiDARs without data, with the reasons.
    pub fn silent(&self) -> impl Iterator<Item = String> {
        self.0.iter().filter_map(|lidar| match &lidar.source {
            Source::Absent(reason) => Some(format!("lidar {} ({reason})", lidar.name)),
            Source::Sweeps(_) if lidar.tally.sweeps == 0 => Some(format!("lidar {} (no returns)", lidar.name)),
            Source::Sweeps(_) => None,
        })
    }

    /// Collects the doubts about their data.
    pub fn doubt(&self, doubts: &mut Doubts) {
        for lidar in &self.0 {
            let Source::Sweeps(source) = &lidar.source else { continue };
            lidar.tally.doubt(&lidar.name, &source.lidar_stats(), source.capture_bytes(), doubts);
            let mut of_lidar = doubts.for_lidar(&lidar.name);
            of_lidar.numbers(&lidar.missing);
            source.form().into_iter().for_each(|form| of_lidar.clouds(form));
            doubts.add_all(of_lidar);
        }
    }

    pub fn position(&self) -> Vec<SecondaryPosition> {
        let position = |lidar: &SecondaryLidar| SecondaryPosition {
            source: match &lidar.source {
                Source::Sweeps(source) => Some(source.position()),
                Source::Absent(_) => None,
            },
            tally: lidar.tally,
        };
        self.0.iter().map(position).collect()
    }

    /// Continues at a position of the same drive.
    pub fn resume(&mut self, positions: Vec<SecondaryPosition>) -> Result<(), DriveError> {
        if positions.len() != self.0.len() {
            return Err(DriveError::OtherDrive);
        }
        for (lidar, SecondaryPosition { source: position, tally }) in self.0.iter_mut().zip(positions) {
            let in_drive = match (&mut lidar.source, position) {
                (Source::Sweeps(source), Some(position)) => {
                    let in_drive = source.resume(position)?;
                    lidar.reported = ReportedCounts::up_to(source.lidar_stats(), LogStats::default());
                    in_drive
                }
                (Source::Absent(_), None) => true,
                _ => false,
            };
            if !in_drive {
                return Err(DriveError::OtherDrive);
            }
            lidar.tally = tally;
            lidar.reported_tally = tally;
        }
        Ok(())
    }
}

impl SecondaryLidar {
    fn sweeps_mut(&mut self) -> Option<&mut SweepSource> {
        match &mut self.source {
            Source::Sweeps(source) => Some(source),
            Source::Absent(_) => None,
        }
    }
}
