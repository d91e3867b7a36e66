//! Received sweeps of all LiDARs, and their grouping.

use crate::{KeptPoints, Revolution, Sweep};
use geometry::Stamp;
use messages::{SweepHeader, SweepPoint};

/// A message of topic `sweep`.
#[derive(Clone, Copy, Debug)]
pub struct RawSweep<'a> {
    /// Number of the message.
    pub seq: u64,
    /// Time of the first shot.
    pub stamp: Stamp,
    /// Header of the message.
    pub header: &'a SweepHeader,
    /// Points of the message.
    pub rows: &'a [SweepPoint],
}

/// A sweep for the odometry, and its points for the submap.
#[derive(Clone, Debug)]
pub struct PreparedSweep {
    /// All points.
    pub sweep: Sweep,
    /// The points for the submap.
    pub kept: KeptPoints,
}

impl RawSweep<'_> {
    /// Converts the points for the odometry. `untimed` is as in [`Sweep::from_rows`].
    pub fn sweep(&self, untimed: Option<Revolution>) -> Sweep {
        Sweep::from_rows(self.stamp, self.header, self.rows, untimed)
    }
    /// Whether another sweep begins during this one.
    fn is_during(&self, other: &Self) -> bool {
        (0..=i64::from(self.header.duration_nanos)).contains(&other.stamp.0.saturating_sub(self.stamp.0))
    }
}

/// Messages of topic `sweep`, grouped.
#[derive(Clone, Debug)]
pub struct SweepsByTick<M> {
    /// Each begins with a sweep of the first LiDAR.
    pub ticks: Vec<Vec<M>>,
    /// Sweeps of other LiDARs without a sweep of the first. In live operation either may be lost.
    pub n_dropped: u64,
}

/// Groups messages: a sweep of the first LiDAR, then the sweeps of the other LiDARs that begin during it.
pub fn sweeps_by_tick<M>(messages: Vec<M>, raw: impl Fn(&M) -> RawSweep<'_>) -> SweepsByTick<M> {
    let mut ticks = Vec::<Vec<M>>::new();
    let mut n_dropped = 0;
    for message in messages {
        match ticks.last_mut() {
            _ if raw(&message).header.lidar == 0 => ticks.push(vec![message]),
            Some(tick) if tick.first().is_some_and(|first| raw(first).is_during(&raw(&message))) => tick.push(message),
            _ => n_dropped += 1,
        }
    }
    SweepsByTick { ticks, n_dropped }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Message {
        header: SweepHeader,
        stamp: i64,
    }

    fn raw_sweep_from(message: &Message) -> RawSweep<'_> {
        RawSweep { seq: 0, stamp: Stamp(message.stamp), header: &message.header, rows: &[] }
    }

    #[test]
    fn sweeps_of_other_lidars_without_one_of_the_first_are_dropped() {
        let header = |lidar| SweepHeader { duration_nanos: 100, lidar, ..SweepHeader::default() };
        let messages = [(1, 40), (0, 50), (2, 50), (1, 151), (0, 150), (1, 160), (2, 250)];
        let messages = messages.map(|(lidar, stamp)| Message { header: header(lidar), stamp });
        let SweepsByTick { ticks, n_dropped } = sweeps_by_tick(messages.into(), raw_sweep_from);
        let stamps: Vec<Vec<i64>> =
            ticks.iter().map(|tick| tick.iter().map(|message| message.stamp).collect()).collect();
        assert_eq!((stamps, n_dropped), (vec![vec![50, 50], vec![150, 160, 250]], 2));
    }
}
