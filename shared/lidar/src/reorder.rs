//! Puts data packets in the order of the sensor's clock: networks deliver packets out of order.
//!
//! A packet that follows the previous one without a gap is passed on immediately. After a gap, packets are held until the
//! missing ones arrive or [`WINDOW`] packets are waiting.

use super::clock::{Clock, Step};
use geometry::Stamp;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Maximum delay in packets: 4.4 ms of an HDL-32E. Queues of network cards and switches exchange neighbors; a packet with
/// a longer delay is counted as late.
pub(super) const WINDOW: usize = 8;

/// Position of a packet in the captures, in the order of reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Place {
    /// Index of the file.
    pub(super) file: usize,
    /// Offset of its record in the file; of its last fragment, if it was sent in fragments.
    pub(super) offset: u64,
    /// Offset from which the file must be read to get it.
    pub(super) begin: u64,
}

/// A data packet of the sensor.
#[derive(Clone, Debug)]
pub(super) struct Held {
    pub(super) place: Place,
    pub(super) captured: Stamp,
    /// Its time, see [`Clock::step`].
    pub(super) nanos: i64,
    pub(super) bytes: Vec<u8>,
}

/// Packets that wait for earlier ones, in the order of arrival.
#[derive(Clone, Debug, Default)]
pub(super) struct Reorder(VecDeque<Held>);

impl Reorder {
    pub(super) fn push(&mut self, packet: Held) {
        self.0.push_back(packet);
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Places of the held packets.
    pub(super) fn places(&self) -> [Option<Place>; WINDOW] {
        std::array::from_fn(|index| self.0.get(index).map(|held| held.place))
    }

    /// The next packet by the clock, and whether it overtakes packets that arrived before it. `None` while packets before it may
    /// still arrive. `packet_nanos` is the time from one packet to the next. After the end of the recording every packet is next.
    pub(super) fn take(&mut self, clock: &Clock, packet_nanos: i64, is_end: bool) -> Option<(Held, bool)> {
        // Packets sent after the clock was set follow all packets sent before.
        let lead = |held: &Held| lead_nanos(*clock, held).map_or(i64::MAX, |nanos| nanos.max(-1));
        let (index, lead) = self.0.iter().map(lead).enumerate().min_by_key(|(_, lead)| *lead)?;
        let follows = lead == i64::MAX || n_lost(clock, lead, packet_nanos) == 0;
        if !follows && !is_end && self.0.len() <= WINDOW {
            return None;
        }
        self.0.remove(index).map(|held| (held, index > 0))
    }
}

/// Packets missing between two that are `nanos` apart.
pub(super) fn n_lost(clock: &Clock, nanos: i64, packet_nanos: i64) -> i64 {
    if clock.is_regular() && packet_nanos > 0 { ((nanos + packet_nanos / 2) / packet_nanos - 1).max(0) } else { 0 }
}

/// Time after the last packet; `None` if the clock jumped.
fn lead_nanos(mut clock: Clock, held: &Held) -> Option<i64> {
    match clock.step(held.nanos, held.captured) {
        Step::Forward { nanos, .. } => Some(nanos),
        Step::Repeated { .. } => Some(0),
        Step::Late => Some(-1),
        Step::Jump { .. } | Step::RecorderJump { .. } | Step::SetBack { .. } => None,
    }
}
