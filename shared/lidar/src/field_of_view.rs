//! Sectors in which a LiDAR is set to fire nothing: no packet is lost there.

use crate::{Blocks, TURN};
use geometry::Stamp;

/// Width of the bins of the encoder, counts.
const BIN: u16 = 100;
const N_BINS: usize = (TURN / BIN) as usize;
/// Least width of a sector that counts as set, in bins.
const MIN_BINS: usize = 10;
/// Least number of revolutions in which nothing is fired there. Lost packets do not leave the same sector empty as often.
const MIN_TURNS: i64 = 5;
/// The encoder never steps back by as much within a revolution, counts.
const STEP_BACK: u16 = 1000;
/// Plausible times of a revolution, ns.
const TURN_NANOS: std::ops::RangeInclusive<i64> = 10_000_000..=1_000_000_000;
/// Largest difference of the silence in a sector from its measured duration, packets: packets do not start at the edges of bins.
const MAX_EDGE_PACKETS: i64 = 3;

/// Encoder angles at which a sensor fires, collected from its first packets.
#[derive(Clone, Debug)]
pub(super) struct FiredAngles {
    bins: [bool; N_BINS],
    last: Option<u16>,
    /// Capture times of the first and the last start of a revolution.
    begins: Option<[Stamp; 2]>,
    n_turns: i64,
}

impl Default for FiredAngles {
    fn default() -> Self {
        Self { bins: [false; N_BINS], last: None, begins: None, n_turns: 0 }
    }
}

/// The widest sector in which nothing is fired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SilentSector {
    /// Encoder counts.
    begin: u16,
    width: u16,
    /// Time of a revolution, ns.
    turn_nanos: i64,
}

impl FiredAngles {
    pub(super) fn add(&mut self, blocks: &Blocks, captured: Stamp) {
        for (_, turned) in (0..blocks.len()).filter_map(|index| blocks.get(index)) {
            if let Some(bin) = self.bins.get_mut(usize::from(turned / BIN)) {
                *bin = true;
            }
            if self.last.is_some_and(|last| turned.saturating_add(STEP_BACK) < last) {
                match &mut self.begins {
                    Some([_, last]) => {
                        *last = captured;
                        self.n_turns += 1;
                    }
                    None => self.begins = Some([captured; 2]),
                }
            }
            self.last = Some(turned);
        }
    }

    /// `None` if the sensor fires all around, or if there are too few revolutions.
    pub(super) fn silent_sector(&self) -> Option<SilentSector> {
        let [first, last] = self.begins.filter(|_| self.n_turns >= MIN_TURNS)?;
        let turn_nanos = Some((last.0 - first.0) / self.n_turns).filter(|nanos| TURN_NANOS.contains(nanos))?;
        // From a bin with shots, so that a sector across zero is in one piece.
        let start = self.bins.iter().position(|is_fired| *is_fired)?;
        let mut widest = (0, 0);
        let mut run = 0;
        for at in (start..start + N_BINS).map(|at| at % N_BINS) {
            run = if self.bins[at] { 0 } else { run + 1 };
            if run > widest.1 {
                widest = ((at + N_BINS + 1 - run) % N_BINS, run);
            }
        }
        let (begin, width) = widest;
        (width >= MIN_BINS).then(|| SilentSector { begin: begin as u16 * BIN, width: width as u16 * BIN, turn_nanos })
    }
}

impl SilentSector {
    /// Time in which the sensor turns from one encoder angle to another, ns, if the sector lies between them.
    pub(crate) fn nanos_across(&self, from: u16, to: u16) -> Option<i64> {
        let turned = |to: u16| (i64::from(to) - i64::from(from)).rem_euclid(i64::from(TURN));
        let is_across = turned(self.begin) + i64::from(self.width) <= turned(to) + i64::from(BIN);
        is_across.then(|| turned(to) * self.turn_nanos / i64::from(TURN))
    }

    /// Packets that are missing between two packets `nanos` apart, of which `n_missing` would be without the sector. `from` and `to`:
    /// encoder counts of their first blocks.
    pub(super) fn n_lost(&self, n_missing: i64, nanos: i64, packet_nanos: i64, [from, to]: [u16; 2]) -> i64 {
        let turned = |from: u16, to: u16| (i64::from(to) - i64::from(from)).rem_euclid(i64::from(TURN));
        let width = i64::from(self.width);
        // Within the packet that starts before the sector, the blocks after it may already follow.
        let is_inside = turned(from, self.begin) + width <= turned(from, to) + i64::from(BIN);
        let n_crossed = nanos / self.turn_nanos + i64::from(is_inside);
        let silent_packets = n_crossed * width * self.turn_nanos / i64::from(TURN) / packet_nanos.max(1);
        let n_lost = n_missing - silent_packets;
        if n_lost <= MAX_EDGE_PACKETS * n_crossed { 0 } else { n_lost }
    }
}
