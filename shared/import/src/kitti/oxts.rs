//! Records of the GNSS and IMU unit of KITTI raw: one file of thirty numbers each (`oxts/dataformat.txt`).

use super::unit_log::UnitLog;
use crate::error::{At, ImportError};
use crate::numbered::Stamps;
use drive::imu::ImuSample;
use files::text_file::read_text;
use geometry::{Geodetic, Isometry3, Stamp, UnitQuaternion};
use lidar::nmea::{Fix, StatedDeviation};
use std::path::Path;

/// Largest record, bytes: thirty numbers have about 500.
const MAX_BYTES: u64 = 4096;
/// Names of the numbers.
const FIELDS: [&str; 30] = [
    "lat",
    "lon",
    "alt",
    "roll",
    "pitch",
    "yaw",
    "vn",
    "ve",
    "vf",
    "vl",
    "vu",
    "ax",
    "ay",
    "az",
    "af",
    "al",
    "au",
    "wx",
    "wy",
    "wz",
    "wf",
    "wl",
    "wu",
    "pos_accuracy",
    "vel_accuracy",
    "navstat",
    "numsats",
    "posmode",
    "velmode",
    "orimode",
];
/// Minimum speed for a course, m/s.
const MIN_COURSE_MPS: f64 = 0.1;
/// Number of satellites needed for a position.
const MIN_SATELLITES: f64 = 4.0;

/// Reads all records of `oxts/data`.
pub(crate) fn read(folder: &Path, stamps: &Stamps) -> Result<UnitLog, ImportError> {
    let mut log = UnitLog::default();
    for file in stamps.records(&folder.join("data"), ".txt")? {
        let text = read_text(&file.path, MAX_BYTES).at(&file.path)?;
        let record = numbers(&text, &file.path)?;
        let [latitude, longitude, altitude, roll, pitch, yaw, north, east, ..] = record;
        let place = Geodetic::new(latitude, longitude, altitude).ok_or_else(|| {
            let rule = format!("lat {latitude}, lon {longitude} must be -90 to 90 and -180 to 180 degrees");
            ImportError::at(&file.path, rule)
        })?;
        let [ax, ay, az] = [record[11], record[12], record[13]];
        let [wx, wy, wz] = [record[17], record[18], record[19]];
        let speed_mps = north.hypot(east);
        let course_deg = (speed_mps >= MIN_COURSE_MPS).then(|| east.atan2(north).to_degrees().rem_euclid(360.0));
        let fix = Fix {
            stamp: Stamp(file.stamp),
            position_deg: [latitude, longitude],
            altitude_m: Some(altitude),
            speed_mps: Some(speed_mps),
            course_deg,
            hdop: None,
            satellites: record[26].clamp(0.0, 99.0) as u32,
            quality: quality(record[23], record[26]),
            vdop: None,
            deviation: (record[23] > 0.0).then_some(StatedDeviation { across_m: record[23], up_m: record[23] }),
        };
        let sample = ImuSample { stamp: Stamp(file.stamp), acceleration: [ax, ay, az], angular_rate: [wx, wy, wz] };
        // Roll about x, then pitch about y, then yaw about z; yaw 0 is east, as in the devkit's convertOxtsToPose.
        let world_from_body_rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        log.push(fix, sample, place, Isometry3::from_parts([0.0; 3].into(), world_from_body_rotation));
    }
    if log.is_empty() {
        return Err(ImportError::at(&folder.join("data"), "has no records *.txt"));
    }
    Ok(log)
}

/// GGA quality derived from the stated deviation of the position, m. The unit bridges gaps of the satellites with its IMU.
fn quality(deviation_m: f64, satellites: f64) -> u32 {
    match deviation_m {
        _ if satellites < MIN_SATELLITES => 6,
        m if m <= 0.1 => 4,
        m if m <= 0.5 => 5,
        m if m <= 2.0 => 2,
        _ => 1,
    }
}

fn numbers(text: &str, path: &Path) -> Result<[f64; 30], ImportError> {
    let words: Vec<&str> = text.split_whitespace().collect();
    if words.len() != FIELDS.len() {
        let rule = format!("{} numbers; a record has {}: {}", words.len(), FIELDS.len(), FIELDS.join(" "));
        return Err(ImportError::at(path, rule));
    }
    let mut numbers = [0.0; 30];
    for (((number, word), name), field) in numbers.iter_mut().zip(words).zip(FIELDS).zip(1..) {
        let value = word.parse().ok().filter(|value: &f64| value.is_finite());
        *number = value
            .ok_or_else(|| ImportError::at(path, format!("field {field}, {name}: {word:?} must be a finite number")))?;
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quality_follows_deviation_and_satellites() {
        for (deviation_m, satellites, expected) in
            [(0.05, 9.0, 4), (0.3, 9.0, 5), (1.0, 7.0, 2), (5.0, 7.0, 1), (0.05, 3.0, 6), (0.05, -1.0, 6)]
        {
            assert_eq!(quality(deviation_m, satellites), expected, "{deviation_m} m, {satellites} satellites");
        }
    }
}
