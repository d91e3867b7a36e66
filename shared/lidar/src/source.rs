//! The sender of the data packets of a sensor, which may change its port.
//!
//! A sensor that was without power, or whose driver was restarted, may send from another port. It is followed once the earlier port is
//! silent. Two senders at once are two sensors: the first one is kept.

use crate::LidarStats;
use geometry::Stamp;
use serde::{Deserialize, Serialize};
use std::net::SocketAddrV4;

/// Time without a packet after which another port of the sensor is followed, ns.
const SILENCE_NANOS: i64 = 1_000_000_000;
/// Time after the first packet of another port from which a packet of the first port shows that both send, ns. It is longer than any
/// delay within a network.
const OVERLAP_NANOS: i64 = 100_000_000;
/// Largest number of other ports that are remembered.
const MAX_RIVALS: usize = 16;

/// The port that is followed, and other ports of the same address.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Source {
    current: SocketAddrV4,
    /// Capture time of its last packet.
    last: Option<Stamp>,
    candidate: Option<Candidate>,
    /// Ports that sent while the current one did.
    rivals: Vec<SocketAddrV4>,
}

/// A port that may replace the current one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Candidate {
    source: SocketAddrV4,
    /// Capture time of its first packet.
    first: Stamp,
}

impl Source {
    pub(super) fn new(current: SocketAddrV4) -> Self {
        Self { current, last: None, candidate: None, rivals: Vec::new() }
    }

    /// Whether a data packet from the address of the sensor belongs to it.
    pub(super) fn take(&mut self, source: SocketAddrV4, captured: Stamp, stats: &mut LidarStats) -> bool {
        if source == self.current {
            if let Some(candidate) = self.candidate
                && captured.0.saturating_sub(candidate.first.0) > OVERLAP_NANOS
            {
                self.candidate = None;
                if self.rivals.len() < MAX_RIVALS {
                    self.rivals.push(candidate.source);
                }
            }
            self.last = Some(captured);
            return true;
        }
        if self.rivals.contains(&source) {
            stats.second_source_packets += 1;
            stats.foreign_packets += 1;
            return false;
        }
        let candidate = *self.candidate.get_or_insert(Candidate { source, first: captured });
        let silent_nanos = captured.0.saturating_sub(self.last.unwrap_or(candidate.first).0);
        if candidate.source != source || silent_nanos < SILENCE_NANOS {
            stats.foreign_packets += 1;
            return false;
        }
        stats.source_changes += 1;
        stats.source_silent_ms += silent_nanos.unsigned_abs() / 1_000_000;
        *self =
            Self { current: source, last: Some(captured), candidate: None, rivals: std::mem::take(&mut self.rivals) };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(port: u16) -> SocketAddrV4 {
        SocketAddrV4::new([192, 168, 1, 201].into(), port)
    }

    /// Takes a packet of each port every 10 ms, from and to these times in ms. Returns the taken packets of each port and the counters.
    fn taken(senders: &[(u16, i64, i64)]) -> (Vec<usize>, LidarStats) {
        let mut source = Source::new(port(senders[0].0));
        let mut stats = LidarStats::default();
        let mut n = vec![0; senders.len()];
        for millis in (0..100_000).step_by(10) {
            for (index, (number, begin, end)) in senders.iter().enumerate() {
                if (*begin..*end).contains(&millis) {
                    n[index] += usize::from(source.take(port(*number), Stamp(millis * 1_000_000), &mut stats));
                }
            }
        }
        (n, stats)
    }

    #[test]
    fn another_port_is_followed_after_a_silence() {
        let (n, stats) = taken(&[(1, 0, 10_000), (2, 30_000, 40_000), (3, 40_500, 50_000)]);
        // The last port waits until the one before is silent for a second, half of it with packets.
        assert_eq!((n, stats.foreign_packets), (vec![1000, 1000, 950 - 49], 49));
        assert_eq!((stats.source_changes, stats.source_silent_ms, stats.second_source_packets), (2, 20_010 + 1_000, 0));
    }

    #[test]
    fn second_of_two_senders_is_never_followed() {
        let (n, stats) = taken(&[(1, 0, 10_000), (2, 3_000, 40_000)]);
        assert_eq!((n, stats.source_changes), (vec![1000, 0], 0));
        // Eleven packets before both are known to send.
        assert_eq!((stats.second_source_packets, stats.foreign_packets), (3700 - 11, 3700));
        // A late packet of the first port is not a second sender.
        let mut source = Source::new(port(1));
        let mut stats = LidarStats::default();
        let mut take = |number, millis: i64| source.take(port(number), Stamp(millis * 1_000_000), &mut stats);
        assert!(take(1, 0) && !take(2, 50) && take(1, 60) && !take(2, 70) && take(2, 1100));
    }
}
