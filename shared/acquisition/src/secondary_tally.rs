//! Published data of a secondary LiDAR.

use crate::doubts::Doubts;
use crate::rows::{StampedHeader, slice_header};
use drive::SweepInfo;
use lidar::{LidarStats, SliceInfo};
use serde::{Deserialize, Serialize};

/// Counts since the start of the drive.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct SecondaryTally {
    /// Sweeps of the first LiDAR.
    pub ticks: u64,
    /// Sweeps of the first LiDAR with returns of this LiDAR.
    pub sweeps: u64,
    /// Returns between two sweeps of the first LiDAR, or beyond the limit of one sweep.
    pub points_skipped: u64,
    /// Cloud files that cannot be read.
    pub bad_sweeps: u64,
}

impl SecondaryTally {
    /// Counts the returns during a sweep of the first LiDAR. `None` without returns. `lidar`: index of the LiDAR.
    pub fn add(
        &mut self,
        slice: Option<SliceInfo>,
        first: &SweepInfo,
        lidar: usize,
        n_rings: usize,
    ) -> Option<StampedHeader> {
        // Returns recorded before the first tick are not a loss.
        self.points_skipped += slice.filter(|_| self.ticks > 0).map_or(0, |slice| slice.n_skipped);
        self.ticks += 1;
        let slice = slice.filter(|slice| slice.n_returns > 0)?;
        let stamp = slice.stamp?;
        self.sweeps += 1;
        let end = first.stamp.0 + i64::from(first.duration_nanos);
        Some(StampedHeader { header: slice_header(&slice, stamp, end, lidar, n_rings), stamp: stamp.0 })
    }

    /// Names and numbers since an earlier tally.
    pub fn since(&self, before: &Self) -> [(&'static str, u64); 4] {
        let n_missing = |tally: &Self| tally.ticks - tally.sweeps;
        [
            ("sweeps", self.sweeps - before.sweeps),
            ("sweeps_missing", n_missing(self) - n_missing(before)),
            ("points_skipped", self.points_skipped - before.points_skipped),
            ("bad_sweeps", self.bad_sweeps - before.bad_sweeps),
        ]
    }

    /// Collects the doubts about the LiDAR `name` and its packets.
    pub fn doubt(&self, name: &str, stats: &LidarStats, n_bytes: u64, doubts: &mut Doubts) {
        let mut of_lidar = doubts.for_lidar(name);
        of_lidar.captures(stats, n_bytes);
        // Its stamps are matched to the stamps of the first LiDAR.
        of_lidar.clock(stats, true);
        let Self { ticks, sweeps, bad_sweeps, .. } = *self;
        of_lidar.sweeps(bad_sweeps, sweeps + bad_sweeps);
        // A LiDAR without any returns is silent.
        if sweeps > 0 {
            of_lidar.missing_sweeps(ticks - sweeps, ticks);
        }
        doubts.add_all(of_lidar);
    }
}

/// Counters with the name of their LiDAR; zeros are left out.
pub(crate) fn named(
    name: &str,
    counts: impl IntoIterator<Item = (&'static str, u64)>,
) -> impl Iterator<Item = (String, u64)> {
    counts.into_iter().filter(|(_, n)| *n > 0).map(move |(counter, n)| (format!("lidar_{name}_{counter}"), n))
}
