//! The IMU: rate, units, gravity.

use super::DriveReport;
use super::stream::Stream;
use anyhow::Context;
use drive::Drive;
use drive::imu::ImuError;
use geometry::Vector3;

/// Mean length of the specific force while driving, m/s^2: gravity, and the vibration and braking of a vehicle.
const GRAVITY: std::ops::RangeInclusive<f64> = 9.3..=10.5;
/// Mean length of the specific force while driving, g.
const GRAVITY_IN_G: std::ops::RangeInclusive<f64> = 0.95..=1.07;
/// Largest root mean square of the angular rate of a vehicle, rad/s: it turns by less than half a radian per second.
const MAX_RATE: f64 = 1.0;
/// Least share of gravity along z of a level IMU: 25 degrees.
const MIN_UP_SHARE: f64 = 0.9;

/// Adds the stream, facts and doubts.
pub fn add(drive: &Drive, report: &mut DriveReport) -> anyhow::Result<()> {
    let Some(entry) = &drive.manifest().imu else {
        report.section("IMU", vec!["none".to_owned()]);
        return Ok(());
    };
    let path = drive.folder().join(&entry.file);
    let reader = drive.imu().with_context(|| path.display().to_string())?;
    let mut stamps = Vec::new();
    let mut n_bad = 0_u64;
    let mut first_error = None;
    let mut force = Vector3::zeros();
    let mut length = 0.0;
    let mut squares = 0.0;
    for sample in reader.into_iter().flatten() {
        match sample {
            Ok(sample) => {
                stamps.push(sample.stamp.0);
                let acceleration = Vector3::from(sample.acceleration);
                force += acceleration;
                length += acceleration.norm();
                squares += Vector3::from(sample.angular_rate).norm_squared();
            }
            Err(error @ (ImuError::Line { .. } | ImuError::Io(_))) => {
                n_bad += 1;
                first_error.get_or_insert(error.to_string());
            }
        }
    }
    let n_samples = stamps.len();
    let size = path.metadata().map_or(0, |metadata| metadata.len());
    report.streams.push(Stream::new("imu", "CSV", stamps).with_files(1, size));
    if let Some(error) = first_error {
        report.doubt(format!("imu: {n_bad} lines are damaged, the first: {}: {error}", path.display()));
    }
    if n_samples == 0 {
        report.doubt(format!("imu: no sample in {}", path.display()));
        return Ok(());
    }
    let n = n_samples as f64;
    let force = force / n;
    let length = length / n;
    let rate = (squares / n).sqrt();
    let lines = vec![
        format!(
            "mean specific force: {length:.3} m/s^2; vector {:.2} {:.2} {:.2} in the body frame",
            force.x, force.y, force.z
        ),
        format!("angular rate, RMS: {rate:.3} rad/s"),
    ];
    if GRAVITY_IN_G.contains(&length) {
        report.doubt(format!("imu: the mean specific force is {length:.3}: the unit seems to be g, must be m/s^2"));
    } else if !GRAVITY.contains(&length) {
        report.doubt(format!("imu: the mean specific force is {length:.3} m/s^2, expected about 9.81"));
    } else if force.z < MIN_UP_SHARE * length {
        report.doubt(format!(
            "imu: gravity is not along +z of the body ({:.2} {:.2} {:.2}): check the axes and [imu] body_from_imu",
            force.x, force.y, force.z
        ));
    }
    if rate > MAX_RATE {
        report
            .doubt(format!("imu: the angular rate has an RMS of {rate:.2}: the unit seems to be deg/s, must be rad/s"));
    }
    report.section("IMU", lines);
    Ok(())
}
