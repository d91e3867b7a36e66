//! SMRMSG, accuracy of a smoothed trajectory (Applanix): records of 10 little-endian doubles, without header.
//!
//! Time (s, as in the SBET), then root mean squares: position north, east and down (m), velocity north, east and down
//! (m/s), roll, pitch and heading (minutes of arc). Its rate differs from the rate of the SBET.

/// Bytes of a record.
pub const RECORD_BYTES: usize = 10 * 8;

/// Standard deviations of a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmrmsgRecord {
    /// Time, s.
    pub time_s: f64,
    /// Position towards north, east and down, m.
    pub north_east_down_m: [f64; 3],
    /// Velocity towards north, east and down, m/s.
    pub velocity_mps: [f64; 3],
    /// Roll, pitch and heading, minutes of arc.
    pub roll_pitch_heading_arcmin: [f64; 3],
}

/// A file that is not SMRMSG.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SmrmsgError {
    /// The size is not a multiple of the record size.
    #[error(
        "{n_bytes} bytes are not a whole number of records of {RECORD_BYTES} bytes; the file is cut off or not SMRMSG"
    )]
    Size {
        /// Size of the file.
        n_bytes: usize,
    },
    /// A number is not a deviation.
    #[error("record {record} (byte {}): expected finite numbers, deviations not negative", record * RECORD_BYTES)]
    Invalid {
        /// Number of the record, from 0.
        record: usize,
    },
}

/// Reads all records of a file.
pub fn records_from_smrmsg(bytes: &[u8]) -> Result<Vec<SmrmsgRecord>, SmrmsgError> {
    let (rows, rest) = bytes.as_chunks::<RECORD_BYTES>();
    if !rest.is_empty() {
        return Err(SmrmsgError::Size { n_bytes: bytes.len() });
    }
    let record = |(record, row): (usize, &[u8; RECORD_BYTES])| {
        let mut numbers = [0.0; 10];
        for (number, bytes) in numbers.iter_mut().zip(row.as_chunks::<8>().0) {
            *number = f64::from_le_bytes(*bytes);
        }
        let [time_s, n, e, d, vn, ve, vd, roll, pitch, heading] = numbers;
        let is_sound = time_s.is_finite() && numbers[1..].iter().all(|value| value.is_finite() && *value >= 0.0);
        is_sound.then_some(()).ok_or(SmrmsgError::Invalid { record })?;
        Ok(SmrmsgRecord {
            time_s,
            north_east_down_m: [n, e, d],
            velocity_mps: [vn, ve, vd],
            roll_pitch_heading_arcmin: [roll, pitch, heading],
        })
    };
    rows.iter().enumerate().map(record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cut_off_files_and_negative_deviations_are_refused() {
        let bytes: Vec<u8> = [1.0, 0.1, 0.1, -0.2, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0].map(f64::to_le_bytes).concat();
        assert_eq!(records_from_smrmsg(&bytes), Err(SmrmsgError::Invalid { record: 0 }));
        assert_eq!(records_from_smrmsg(&bytes[..79]), Err(SmrmsgError::Size { n_bytes: 79 }));
    }

    #[real_data::test("trajectories/applanix/smrmsg.smrmsg", "trajectories/applanix/smrmsg.txt")]
    fn records_equal_the_decoded_text_of_applanix() {
        let path = |name: &str| real_data::path(&format!("trajectories/applanix/{name}"));
        let records = records_from_smrmsg(&std::fs::read(path("smrmsg.smrmsg")).expect("reads")).expect("is SMRMSG");
        let text = std::fs::read_to_string(path("smrmsg.txt")).expect("reads");
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|field| field.parse().expect("a number")).collect())
            .collect();
        assert_eq!(records.len(), rows.len());
        for (record, row) in records.iter().zip(rows) {
            let SmrmsgRecord { time_s, north_east_down_m, velocity_mps, roll_pitch_heading_arcmin } = record;
            let numbers = [&[*time_s][..], north_east_down_m, velocity_mps, roll_pitch_heading_arcmin].concat();
            assert!(numbers.iter().zip(&row).all(|(a, b)| (a - b).abs() < 6e-7), "{record:?} {row:?}");
        }
    }
}
