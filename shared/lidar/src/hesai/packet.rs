//! Layout of data packets.

use crate::TURN;
use files::calendar;

/// Positions of the fields in the packets of a model. Offsets are from the end of the blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) header: &'static [(usize, u8)],
    pub(super) header_bytes: usize,
    /// Bytes before the angle of a block.
    pub(super) flag_bytes: usize,
    pub(super) n_blocks: usize,
    pub(super) n_beams: usize,
    /// Bytes of a return.
    pub(super) return_bytes: usize,
    /// Unit of ranges, mm; 0 = in the header.
    pub(super) unit_mm: u8,
    mode_at: usize,
    date_at: usize,
    micros_at: usize,
    tail_bytes: usize,
}

pub(super) static PANDAR40P: Layout = Layout {
    header: &[(0, 0xff), (1, 0xee)],
    header_bytes: 0,
    flag_bytes: 2,
    n_blocks: 10,
    n_beams: 40,
    return_bytes: 3,
    unit_mm: 4,
    micros_at: 10,
    mode_at: 14,
    date_at: 16,
    tail_bytes: 22,
};
pub(super) static XT32: Layout = Layout {
    header: &[(0, 0xee), (1, 0xff), (2, 6), (6, 32), (7, 8)],
    header_bytes: 12,
    flag_bytes: 0,
    n_blocks: 8,
    n_beams: 32,
    return_bytes: 4,
    unit_mm: 0,
    mode_at: 10,
    date_at: 13,
    micros_at: 19,
    tail_bytes: 24,
};
pub(super) static QT64: Layout = Layout {
    header: &[(0, 0xee), (1, 0xff), (2, 3), (6, 64), (7, 4)],
    header_bytes: 12,
    flag_bytes: 0,
    n_blocks: 4,
    n_beams: 64,
    return_bytes: 4,
    unit_mm: 0,
    micros_at: 12,
    mode_at: 16,
    date_at: 18,
    tail_bytes: 24,
};

/// Bytes of the number of the packet.
const NUMBER_BYTES: usize = 4;

impl Layout {
    pub(super) const fn block_bytes(&self) -> usize {
        self.flag_bytes + 2 + self.n_beams * self.return_bytes
    }

    const fn blocks_end(&self) -> usize {
        self.header_bytes + self.n_blocks * self.block_bytes()
    }

    pub(super) fn is_data(&self, payload: &[u8]) -> bool {
        let n_bytes = self.blocks_end() + self.tail_bytes;
        (payload.len() == n_bytes || payload.len() == n_bytes + NUMBER_BYTES)
            && self.header.iter().all(|(at, byte)| payload[*at] == *byte)
    }

    /// Angle and returns of a block of a data packet; `None` for an invalid flag or angle.
    #[inline]
    pub(super) fn block<'a>(&self, payload: &'a [u8], index: usize) -> Option<(u16, &'a [u8])> {
        let block = payload.get(self.header_bytes + index * self.block_bytes()..)?.get(..self.block_bytes())?;
        let (flag, rest) = block.split_at(self.flag_bytes);
        let (angle, returns) = rest.split_first_chunk()?;
        let angle = u16::from_le_bytes(*angle);
        ((flag.is_empty() || flag == [0xff, 0xee]) && angle < TURN).then_some((angle, returns))
    }

    /// Unit of ranges of a data packet, m.
    pub(super) fn unit_m(&self, payload: &[u8]) -> f32 {
        f32::from(if self.unit_mm > 0 { self.unit_mm } else { payload[9] }) * 1e-3
    }

    /// Number of echoes of a data packet.
    pub(super) fn n_echoes(&self, payload: &[u8]) -> usize {
        // 39 last and strongest, 3b first and last, 3c first and strongest.
        match payload[self.blocks_end() + self.mode_at] {
            0x39 | 0x3b | 0x3c => 2,
            _ => 1,
        }
    }
}

/// Time of a data packet, ns since 1970.
pub(super) fn nanos(layout: &Layout, payload: &[u8]) -> i64 {
    let tail = &payload[layout.blocks_end()..];
    let [year, month, day, hour, minute, second]: [u8; 6] = std::array::from_fn(|i| tail[layout.date_at + i]);
    // Years since 1900; older firmware counts since 2000.
    let year = 1900 + i64::from(year) + if year < 70 { 100 } else { 0 };
    let micros = tail[layout.micros_at..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
    // A clock that was never set may have no date.
    let days = calendar::days_from_date(year, i64::from(month), i64::from(day)).unwrap_or(0);
    let seconds = days * 86_400 + i64::from(hour) * 3600 + i64::from(minute) * 60 + i64::from(second);
    seconds * 1_000_000_000 + i64::from(micros) * 1000
}

/// Offset of the byte in a packet of the receiver that reports whether the clock follows the pulse per second.
const PULSE_LOCK_AT: usize = 507;

/// Whether the clock follows the pulse per second, by a packet of the receiver at the sensor; `None` if the packet does
/// not report it.
pub(crate) fn is_pulse_locked(payload: &[u8]) -> Option<bool> {
    match payload.get(PULSE_LOCK_AT).filter(|_| is_gps(payload))? {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}

/// Whether a payload is a packet of the receiver at the sensor.
pub(crate) fn is_gps(payload: &[u8]) -> bool {
    payload.len() == 512 && payload.starts_with(&[0xff, 0xee])
}
