//! Reassembles IP packets that were sent in fragments: packets of an Ouster are larger than an Ethernet frame.

use super::link::Fragment;
use std::collections::VecDeque;

/// Incomplete packets that are kept. Sensors send one packet after the other, so additional incomplete packets have lost
/// fragments.
const MAX_PARTIAL: usize = 8;
/// An incomplete packet is dropped this many bytes of the capture after its first fragment: 100 packets of an Ouster.
const MAX_DISTANCE: u64 = 4 << 20;
/// Most bytes of an IP packet.
const MAX_BYTES: usize = 65_535;

/// Packets with missing fragments.
#[derive(Debug, Default)]
pub(super) struct Fragments {
    partial: VecDeque<Partial>,
    /// The last packet that was completed.
    whole: Vec<u8>,
}

#[derive(Debug)]
struct Partial {
    key: ([u8; 8], u16),
    /// Offset of the record of its first fragment.
    begin: u64,
    /// Start and end of the parts so far, in order.
    parts: Vec<(usize, usize)>,
    /// Length, known once the last fragment has arrived.
    total: Option<usize>,
    bytes: Vec<u8>,
}

/// Result of [`Fragments::add`].
pub(super) struct Added {
    /// Whether the packet is complete, and the offset of its first fragment.
    pub(super) whole: Option<u64>,
    /// Fragments of packets that were dropped.
    pub(super) dropped: u64,
}

impl Fragments {
    /// Adds the fragment of the record at `offset`. [`Fragments::whole`] has the packet if it is complete.
    pub(super) fn add(&mut self, fragment: &Fragment<'_>, offset: u64) -> Added {
        let mut dropped = 0;
        let index = self.partial.iter().position(|partial| partial.key == fragment.key).unwrap_or_else(|| {
            if self.partial.len() == MAX_PARTIAL {
                dropped += self.partial.pop_front().map_or(0, |oldest| oldest.parts.len() as u64);
            }
            let parts = Vec::new();
            let bytes = Vec::new();
            self.partial.push_back(Partial { key: fragment.key, begin: offset, parts, total: None, bytes });
            self.partial.len() - 1
        });
        let partial = &mut self.partial[index];
        if !partial.add(fragment) {
            dropped += partial.parts.len() as u64 + 1;
            self.partial.remove(index);
            return Added { whole: None, dropped };
        }
        let whole = partial.is_whole().then_some(partial.begin);
        if whole.is_some()
            && let Some(partial) = self.partial.remove(index)
        {
            self.whole = partial.bytes;
        }
        Added { whole, dropped }
    }

    /// The content of the last packet that was completed.
    pub(super) fn whole(&self) -> &[u8] {
        &self.whole
    }

    /// Drops packets that are too old at a record. Returns the number of their fragments.
    pub(super) fn drop_old(&mut self, offset: u64) -> u64 {
        let mut dropped = 0;
        while self.partial.front().is_some_and(|partial| partial.begin + MAX_DISTANCE < offset) {
            dropped += self.partial.pop_front().map_or(0, |oldest| oldest.parts.len() as u64);
        }
        dropped
    }

    /// Offset of the oldest fragment of an incomplete packet.
    pub(super) fn begin(&self) -> Option<u64> {
        self.partial.front().map(|partial| partial.begin)
    }

    /// Drops all incomplete packets. Returns the number of their fragments.
    pub(super) fn drop_all(&mut self) -> u64 {
        self.partial.drain(..).map(|partial| partial.parts.len() as u64).sum()
    }
}

impl Partial {
    /// `false` if the fragment contradicts the others.
    fn add(&mut self, fragment: &Fragment<'_>) -> bool {
        let begin = fragment.at;
        let end = fragment.at + fragment.bytes.len();
        let place = self.parts.partition_point(|part| part.0 < begin);
        let overlaps =
            place > 0 && self.parts[place - 1].1 > begin || self.parts.get(place).is_some_and(|next| next.0 < end);
        let total = if fragment.is_last { Some(end) } else { self.total };
        let is_behind = total.is_some_and(|total| end > total || self.parts.last().is_some_and(|last| last.1 > total));
        if end > MAX_BYTES || overlaps || is_behind || (fragment.is_last && self.total.is_some()) {
            return false;
        }
        self.total = total;
        self.parts.insert(place, (begin, end));
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        self.bytes[begin..end].copy_from_slice(fragment.bytes);
        true
    }

    fn is_whole(&self) -> bool {
        let n_bytes: usize = self.parts.iter().map(|(begin, end)| end - begin).sum();
        self.total == Some(n_bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fragment(number: u8, at: usize, bytes: &[u8], is_last: bool) -> Fragment<'_> {
        Fragment { key: ([number; 8], 5), at, bytes, is_last }
    }

    #[test]
    fn packet_is_complete_in_any_order_of_its_fragments() {
        let parts = [(0, &b"01234567"[..], false), (8, b"89abcdef", false), (16, b"gh", true)];
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
            let mut fragments = Fragments::default();
            for (step, part) in order.into_iter().enumerate() {
                let (at, bytes, is_last) = parts[part];
                // Of another sender, in between.
                assert!(fragments.add(&fragment(9, at, bytes, false), 1).whole.is_none() || at == 0);
                let added = fragments.add(&fragment(7, at, bytes, is_last), 100 + step as u64);
                assert_eq!((added.whole, added.dropped), ((step == 2).then_some(100), 0));
            }
            assert_eq!(fragments.whole(), b"0123456789abcdefgh");
            assert_eq!(fragments.begin(), Some(1));
            assert_eq!(fragments.drop_all(), 3);
        }
    }

    #[test]
    fn contradictions_and_lost_fragments_are_dropped_and_counted() {
        let mut fragments = Fragments::default();
        assert!(fragments.add(&fragment(1, 0, &[0; 16], false), 0).whole.is_none());
        assert_eq!(fragments.add(&fragment(1, 8, &[0; 8], false), 0).dropped, 2, "overlaps");
        assert_eq!(fragments.add(&fragment(1, 65_528, &[0; 8], true), 0).dropped, 1, "too long");
        assert!(fragments.add(&fragment(1, 8, &[0; 8], true), 0).whole.is_none());
        assert_eq!(fragments.add(&fragment(1, 16, &[0; 8], false), 0).dropped, 2, "past the end");
        let dropped: u64 = (0..20).map(|number| fragments.add(&fragment(number, 0, &[0; 8], false), 50).dropped).sum();
        assert_eq!(dropped, 12, "only {MAX_PARTIAL} are kept");
        assert_eq!(fragments.drop_old(50 + MAX_DISTANCE), 0);
        assert_eq!(fragments.drop_old(51 + MAX_DISTANCE), 8);
        assert_eq!(fragments.begin(), None);
    }
}
