//! Sweeps of the topic, prepared for the odometry and for the submap.

use crate::Settings;
use geometry::Stamp;
use messages::SweepTopic;
use registration::{PreparedSweep, RawSweep};
use stage::Received;

/// The sweeps of a tick: of the first LiDAR, and of the secondary LiDARs at the same time.
pub(crate) type Tick = Vec<Received<SweepTopic>>;

pub(crate) fn raw(received: &Received<SweepTopic>) -> RawSweep<'_> {
    let stamp = Stamp(received.stamp());
    RawSweep { seq: received.seq(), stamp, header: received.header(), rows: received.rows() }
}

/// A sweep whose direction of rotation the odometry has not determined: the first one, and the sweeps of secondary
/// LiDARs.
pub(crate) fn prepared(raw: &RawSweep<'_>, settings: &Settings) -> PreparedSweep {
    let sweep = raw.sweep(settings.untimed_turn(None));
    PreparedSweep { kept: settings.kept_points(&sweep), sweep }
}

/// The sweeps of a tick and their prepared points, in the order of the LiDARs.
pub(crate) struct PreparedTick {
    pub tick: Tick,
    pub sweeps: Vec<PreparedSweep>,
}

impl PreparedTick {
    pub fn new(tick: Tick, settings: &Settings) -> Self {
        Self { sweeps: tick.iter().map(|received| prepared(&raw(received), settings)).collect(), tick }
    }
    pub fn n_kept(&self) -> usize {
        self.sweeps.iter().map(|sweep| sweep.kept.indices.len()).sum()
    }
}
