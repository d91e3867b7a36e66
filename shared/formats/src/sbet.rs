//! SBET, smoothed best estimate of trajectory (Applanix): records of 17 little-endian doubles, without header.
//!
//! ```text
//!  0  time, s                           7  roll, pitch, platform heading, rad (body: forward, right, down)
//!  1  latitude, longitude, rad         10  wander angle, rad
//!  3  height above the ellipsoid, m    11  acceleration of the body, m/s²
//!  4  velocity, m/s                    14  turn rates of the body, rad/s
//! ```
//!
//! The file states neither the week of its times, nor the datum, nor the reference point. Velocities are in axes that
//! differ between programs (wander frame, north-east-down, vehicle): they are read and never used.

use std::f64::consts::PI;

/// Bytes of a record.
pub const RECORD_BYTES: usize = 17 * 8;

/// A pose of an SBET file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SbetRecord {
    /// Seconds of the GPS week, as most programs write it.
    pub time_s: f64,
    /// Latitude, rad.
    pub latitude_rad: f64,
    /// Longitude, rad.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub altitude_m: f64,
    /// Velocity, m/s.
    pub velocity: [f64; 3],
    /// Roll, right side down positive, rad.
    pub roll_rad: f64,
    /// Pitch, nose up positive, rad.
    pub pitch_rad: f64,
    /// Heading of the platform, clockwise, rad.
    pub platform_heading_rad: f64,
    /// Wander angle, rad: zero where the platform is aligned with north.
    pub wander_rad: f64,
    /// Acceleration of the body, m/s².
    pub acceleration: [f64; 3],
    /// Turn rates of the body, rad/s.
    pub turn_rates: [f64; 3],
}

/// A file that is not SBET.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SbetError {
    /// The size is not a multiple of the record size.
    #[error(
        "{n_bytes} bytes are not a whole number of records of {RECORD_BYTES} bytes; the file is cut off or not SBET"
    )]
    Size {
        /// Size of the file.
        n_bytes: usize,
    },
    /// A number of a pose is not finite.
    #[error("record {record} (byte {}): {name} is {value}; expected a finite number", record * RECORD_BYTES)]
    NotFinite {
        /// Number of the record, from 0.
        record: usize,
        /// Name of the number.
        name: &'static str,
        /// Value found.
        value: f64,
    },
    /// An angle beyond its range.
    #[error("record {record} (byte {}): {name} {value} rad is out of range{}", record * RECORD_BYTES, degrees_hint(*value))]
    Angle {
        /// Number of the record, from 0.
        record: usize,
        /// Name of the angle.
        name: &'static str,
        /// Value found.
        value: f64,
    },
}

fn degrees_hint(value: f64) -> &'static str {
    if value.abs() <= 360.0 { "; it would be an angle in degrees: export the file with angles in radians" } else { "" }
}

impl SbetRecord {
    /// Heading of the vehicle, clockwise from north, rad.
    pub fn heading_rad(&self) -> f64 {
        self.platform_heading_rad - self.wander_rad
    }

    /// The numbers in the order of the file.
    fn numbers(&self) -> [f64; 17] {
        let [vx, vy, vz] = self.velocity;
        let [ax, ay, az] = self.acceleration;
        let [wx, wy, wz] = self.turn_rates;
        [
            self.time_s,
            self.latitude_rad,
            self.longitude_rad,
            self.altitude_m,
            vx,
            vy,
            vz,
            self.roll_rad,
            self.pitch_rad,
            self.platform_heading_rad,
            self.wander_rad,
            ax,
            ay,
            az,
            wx,
            wy,
            wz,
        ]
    }

    fn from_numbers(numbers: [f64; 17]) -> Self {
        let [
            time_s,
            latitude_rad,
            longitude_rad,
            altitude_m,
            vx,
            vy,
            vz,
            roll_rad,
            pitch_rad,
            platform_heading_rad,
            wander_rad,
            ax,
            ay,
            az,
            wx,
            wy,
            wz,
        ] = numbers;
        Self {
            time_s,
            latitude_rad,
            longitude_rad,
            altitude_m,
            velocity: [vx, vy, vz],
            roll_rad,
            pitch_rad,
            platform_heading_rad,
            wander_rad,
            acceleration: [ax, ay, az],
            turn_rates: [wx, wy, wz],
        }
    }

    /// The bytes of the record.
    pub fn to_bytes(&self) -> [u8; RECORD_BYTES] {
        let mut bytes = [0; RECORD_BYTES];
        for (bytes, number) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(self.numbers()) {
            *bytes = number.to_le_bytes();
        }
        bytes
    }

    fn check(&self, record: usize) -> Result<(), SbetError> {
        let named = [
            ("time", self.time_s),
            ("latitude", self.latitude_rad),
            ("longitude", self.longitude_rad),
            ("height", self.altitude_m),
            ("roll", self.roll_rad),
            ("pitch", self.pitch_rad),
            ("heading", self.platform_heading_rad),
            ("wander angle", self.wander_rad),
        ];
        if let Some((name, value)) = named.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(SbetError::NotFinite { record, name, value });
        }
        // Longitudes and headings may be written from 0 to a full turn.
        let limits = [PI / 2.0, 2.0 * PI, f64::INFINITY, PI, PI / 2.0, 3.0 * PI, 3.0 * PI];
        let beyond = named[1..].iter().zip(limits).find(|((_, value), limit)| value.abs() > limit + 1e-6);
        match beyond {
            Some(((name, value), _)) => Err(SbetError::Angle { record, name, value: *value }),
            None => Ok(()),
        }
    }
}

/// Reads all records of a file.
pub fn records_from_sbet(bytes: &[u8]) -> Result<Vec<SbetRecord>, SbetError> {
    let (rows, rest) = bytes.as_chunks::<RECORD_BYTES>();
    if !rest.is_empty() {
        return Err(SbetError::Size { n_bytes: bytes.len() });
    }
    let record = |(number, row): (usize, &[u8; RECORD_BYTES])| {
        let mut numbers = [0.0; 17];
        for (number, bytes) in numbers.iter_mut().zip(row.as_chunks::<8>().0) {
            *number = f64::from_le_bytes(*bytes);
        }
        let record = SbetRecord::from_numbers(numbers);
        record.check(number).map(|()| record)
    };
    rows.iter().enumerate().map(record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_survive_round_trip_and_damage_is_named() {
        let record = SbetRecord {
            time_s: 476_818.1,
            latitude_rad: 0.85,
            platform_heading_rad: 3.05,
            wander_rad: -0.02,
            turn_rates: [0.1, 0.2, 0.3],
            ..SbetRecord::default()
        };
        let bytes = [record.to_bytes(), record.to_bytes()].concat();
        assert_eq!(records_from_sbet(&bytes), Ok(vec![record; 2]));
        assert!((record.heading_rad() - 3.07).abs() < 1e-12);
        let text = |record: SbetRecord| records_from_sbet(&record.to_bytes()).expect_err("is invalid").to_string();
        let degrees = text(SbetRecord { latitude_rad: 48.8, ..record });
        assert!(degrees.contains("latitude 48.8 rad is out of range") && degrees.contains("degrees"), "{degrees}");
        let lost = text(SbetRecord { altitude_m: f64::NAN, ..record });
        assert!(lost.contains("record 0 (byte 0): height is NaN"), "{lost}");
        let cut = records_from_sbet(&bytes[..271]).expect_err("is cut off").to_string();
        assert!(cut.contains("271 bytes"), "{cut}");
    }

    #[real_data::test("trajectories/applanix/2-points.sbet", "trajectories/applanix/badfile.sbet")]
    fn records_of_applanix_are_read_and_a_broken_file_is_refused() {
        let read =
            |name: &str| std::fs::read(real_data::path(&format!("trajectories/applanix/{name}"))).expect("reads");
        let records = records_from_sbet(&read("2-points.sbet")).expect("is SBET");
        let [first, second] = records[..] else { panic!("{} records", records.len()) };
        assert!((first.latitude_rad.to_degrees() - 32.545_216).abs() < 1e-5, "{first:?}");
        assert!((second.time_s - first.time_s - 0.005).abs() < 1e-3, "{second:?}");
        assert!(matches!(records_from_sbet(&read("badfile.sbet")), Err(SbetError::Size { n_bytes: 271 })));
    }
}
