//! Sweeps of the topic, prepared for the odometry and for the submap.

use crate::Settings;
use geometry::Stamp;
use messages::SweepTopic;
use registration::{KeptPoints, SelectedOdometry, Sweep, SweepRows};
use stage::Received;

/// A received sweep and its points for the odometry.
pub(crate) struct IncomingSweep {
    pub received: Received<SweepTopic>,
    pub sweep: Sweep,
}

impl IncomingSweep {
    pub fn new(received: Received<SweepTopic>, settings: &Settings, odometry: &SelectedOdometry) -> Self {
        let stamp = Stamp(received.stamp());
        let untimed = settings.untimed_turn(odometry.turning_at(stamp));
        let sweep = Sweep::of_rows(stamp, received.header(), received.rows(), untimed);
        Self { received, sweep }
    }
    pub fn rows<'a>(&'a self, kept: &'a KeptPoints) -> SweepRows<'a> {
        SweepRows { seq: self.received.seq(), raw: self.received.rows(), sweep: &self.sweep, kept }
    }
}
