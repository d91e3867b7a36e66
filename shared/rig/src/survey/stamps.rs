//! Stamps of all sensors.

use crate::error::RigError;
use drive::{Drive, Frame};
use geometry::Stamp;
use lidar::nmea::Fix;

/// Kind of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// The LiDAR.
    Lidar,
    /// A color camera, by index.
    Camera(usize),
    /// A mosaic camera, by index.
    Mosaic(usize),
    /// The receiver.
    Gnss,
    /// The inertial unit.
    Imu,
}

/// The stamps of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorStamps {
    /// Kind of the sensor.
    pub kind: SensorKind,
    /// Name of the sensor.
    pub name: String,
    /// Number of measurements.
    pub n: usize,
    /// First and last stamp; `None` without measurements.
    pub span: Option<[Stamp; 2]>,
    /// Median time between measurements, s.
    pub interval_s: f64,
    /// Longest time between measurements, s.
    pub gap_s: f64,
}

impl SensorStamps {
    fn new(kind: SensorKind, name: &str, mut stamps: Vec<i64>) -> Self {
        stamps.sort_unstable();
        let mut gaps: Vec<i64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.sort_unstable();
        let seconds = |nanos: Option<&i64>| nanos.map_or(0.0, |nanos| *nanos as f64 * 1e-9);
        Self {
            kind,
            name: name.to_owned(),
            n: stamps.len(),
            span: stamps.first().zip(stamps.last()).map(|(first, last)| [Stamp(*first), Stamp(*last)]),
            interval_s: seconds(gaps.get(gaps.len() / 2)),
            gap_s: seconds(gaps.last()),
        }
    }
}

/// The stamps of all sensors of a drive. `span` is the span of the sweeps that were read.
pub fn stamps_of(
    drive: &Drive,
    span: [Stamp; 2],
    fixes: &[Fix],
    n_sweeps: usize,
) -> Result<Vec<SensorStamps>, RigError> {
    let manifest = drive.manifest();
    let lidar = SensorStamps {
        n: n_sweeps,
        interval_s: span[1].seconds_since(span[0]) / n_sweeps.max(1) as f64,
        span: Some(span),
        ..SensorStamps::new(SensorKind::Lidar, &manifest.lidar.model, Vec::new())
    };
    let mut all = vec![lidar];
    let of_camera = |frames: &[Frame], camera: usize| -> Vec<i64> {
        frames.iter().filter(|frame| frame.camera == camera).map(|frame| frame.stamp.0).collect()
    };
    for (index, entry) in manifest.cameras.iter().enumerate() {
        let stamps = of_camera(drive.camera_frames(), index);
        all.push(SensorStamps::new(SensorKind::Camera(index), &entry.name, stamps));
    }
    for (index, entry) in manifest.mosaics.iter().enumerate() {
        let stamps = of_camera(drive.mosaic_frames(), index);
        all.push(SensorStamps::new(SensorKind::Mosaic(index), &entry.name, stamps));
    }
    if manifest.gnss.is_some() || !fixes.is_empty() {
        let stamps = fixes.iter().map(|fix| fix.stamp.0).collect();
        all.push(SensorStamps::new(SensorKind::Gnss, "gnss", stamps));
    }
    if let Some(reader) = drive.imu().map_err(|error| RigError::log(drive, &error))? {
        let stamps = reader.flatten().map(|sample| sample.stamp.0).collect();
        all.push(SensorStamps::new(SensorKind::Imu, "imu", stamps));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interval_is_the_median_and_gap_the_longest() {
        let stamps = [0, 100, 200, 900, 1000].map(|i| i * 1_000_000).to_vec();
        let found = SensorStamps::new(SensorKind::Imu, "imu", stamps);
        assert_eq!((found.n, found.interval_s), (5, 0.1));
        assert!((found.gap_s - 0.7).abs() < 1e-9, "{found:?}");
        assert_eq!(found.span, Some([Stamp(0), Stamp(1_000_000_000)]));
        assert_eq!(SensorStamps::new(SensorKind::Gnss, "gnss", Vec::new()).span, None);
    }
}
