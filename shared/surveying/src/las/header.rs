//! The header of a file.
//!
//! ```text
//!   0  "LASF"                       96  u32 offset of the points
//!   4  u16 source, u16 encoding    100  u32 number of variable length records
//!   8  16 bytes project            104  u8 point format (+ 128: compressed), u16 bytes of a record
//!  24  u8 1, u8 4: version         107  u32 and 5 x u32: numbers of old formats, 0
//!  26  32 bytes system             131  3 x f64 scale, 3 x f64 offset
//!  58  32 bytes software           179  f64 largest and smallest x, then y, then z
//!  90  u16 day of the year, year   227  u64 waveforms, u64 extended records, u32 their number
//!  94  u16 375: bytes of this      247  u64 number of points, 15 x u64 by return
//! ```

use super::record::SCALE_M;
use super::vlr::padded;
use files::calendar::{DAY_NANOS, date_from_days, days_from_date};

/// Bytes of the header.
pub(crate) const HEADER_BYTES: usize = 375;
/// Adjusted standard GPS time (bit 0) and WKT (bit 4), which point formats from 6 on require.
const ENCODING: u16 = 0b1_0001;

/// The header fields that all files of a delivery share.
#[derive(Clone, Debug)]
pub(crate) struct HeaderFacts {
    /// The system that recorded the points.
    pub(crate) system: String,
    /// Software with its version.
    pub(crate) software: String,
    /// Start of the recording, ns since the Unix epoch. A file is dated by its points and not by the time of writing, so
    /// the same run gives the same bytes.
    pub(crate) begin_nanos: i64,
    /// Coordinates that are stored as 0, m.
    pub(crate) offset_m: [f64; 3],
    /// Bytes of a record.
    pub(crate) record_bytes: usize,
}

/// The header fields that differ between files.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LasHeader {
    pub(crate) points_at: u32,
    pub(crate) n_vlrs: u32,
    pub(crate) is_compressed: bool,
    /// Offset and number of extended records.
    pub(crate) evlrs: (u64, u32),
    pub(crate) n_points: u64,
    /// Smallest and largest stored coordinates; arbitrary if there are no points.
    pub(crate) bounds: [[i32; 3]; 2],
}

impl LasHeader {
    /// The bytes in a file.
    pub(crate) fn bytes(&self, facts: &HeaderFacts) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        bytes.extend(b"LASF\0\0");
        bytes.extend(ENCODING.to_le_bytes());
        bytes.extend([0; 16]);
        bytes.extend([1, 4]);
        bytes.extend(padded::<32>(&facts.system));
        bytes.extend(padded::<32>(&facts.software));
        let days = facts.begin_nanos.div_euclid(DAY_NANOS);
        let (year, ..) = date_from_days(days);
        let day = days - days_from_date(year, 1, 1).unwrap_or(days) + 1;
        bytes.extend((day as u16).to_le_bytes());
        bytes.extend((year as u16).to_le_bytes());
        bytes.extend((HEADER_BYTES as u16).to_le_bytes());
        bytes.extend(self.points_at.to_le_bytes());
        bytes.extend(self.n_vlrs.to_le_bytes());
        bytes.push(7 | u8::from(self.is_compressed) << 7);
        bytes.extend((facts.record_bytes as u16).to_le_bytes());
        bytes.extend([0; 24]);
        bytes.extend([SCALE_M; 3].into_iter().chain(facts.offset_m).flat_map(f64::to_le_bytes));
        let [smallest, largest] = self.bounds;
        for axis in 0..3 {
            for stored in [largest[axis], smallest[axis]] {
                bytes.extend((f64::from(stored) * SCALE_M + facts.offset_m[axis]).to_le_bytes());
            }
        }
        bytes.extend([0; 8]);
        bytes.extend(self.evlrs.0.to_le_bytes());
        bytes.extend(self.evlrs.1.to_le_bytes());
        // All points are first returns.
        bytes.extend(self.n_points.to_le_bytes());
        bytes.extend(self.n_points.to_le_bytes());
        bytes.resize(HEADER_BYTES, 0);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_has_date_of_the_recording_and_bounds_in_metres() {
        let facts = HeaderFacts {
            system: "system".to_owned(),
            software: "software 1".to_owned(),
            // 2024-09-13, day 257.
            begin_nanos: 1_726_230_400_000_000_000,
            offset_m: [452_000.0, 5_410_000.0, 0.0],
            record_bytes: 49,
        };
        let bounds = [[-1000, 2, 3], [4, 5000, 6]];
        let header = LasHeader { points_at: 1000, n_vlrs: 3, is_compressed: true, evlrs: (0, 0), n_points: 7, bounds };
        let bytes = header.bytes(&facts);
        assert_eq!(bytes.len(), 375);
        let short = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        assert_eq!((short(6), short(90), short(92), short(94)), (17, 257, 2024, 375));
        assert_eq!((bytes[104], short(105)), (135, 49));
        let double = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"));
        assert_eq!([179, 187, 195].map(double), [452_000.004, 451_999.0, 5_410_005.0]);
        assert_eq!(bytes[247], 7);
        assert_eq!(bytes[255], 7);
    }
}
