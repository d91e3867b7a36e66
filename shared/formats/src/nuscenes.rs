//! nuScenes (Caesar et al., CVPR 2020): sweeps of an HDL-32E as little-endian rows without header, `*.pcd.bin`.
//!
//! A row has x y z intensity ring as f32, 20 bytes. In the lidar frame x points right, y forward and z up. The ring counts from the
//! lowest beam, as everywhere in this project. The intensity is the value of the sensor, 0 to 255.

use crate::cloud::CloudPoint;
use geometry::Stamp;

/// Bytes of a row.
pub const ROW_BYTES: usize = 20;
/// Beams of the HDL-32E.
const N_RINGS: f32 = 32.0;

/// Error of bytes that are not a sweep.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum NuscenesError {
    /// The file ends within a row.
    #[error("{n_bytes} bytes are not a multiple of the row size, {ROW_BYTES} bytes")]
    Size {
        /// Size of the file.
        n_bytes: usize,
    },
    /// The fifth value of a row is not a beam of the sensor.
    #[error("point {index}: ring {ring} must be a whole number from 0 to 31")]
    Ring {
        /// Index of the row.
        index: usize,
        /// The value found.
        ring: f32,
    },
}

/// Points of a sweep with their rings.
pub fn points_from_bin(bytes: &[u8]) -> Result<Vec<(CloudPoint, u8)>, NuscenesError> {
    let (rows, rest) = bytes.as_chunks::<ROW_BYTES>();
    if !rest.is_empty() {
        return Err(NuscenesError::Size { n_bytes: bytes.len() });
    }
    let value = |row: &[u8; ROW_BYTES], at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
    let point = |(index, row)| {
        let point = CloudPoint { x: value(row, 0), y: value(row, 4), z: value(row, 8), intensity: value(row, 12) };
        let is_missing = [point.x, point.y, point.z].iter().any(|value| value.is_nan());
        let ring = if is_missing { 0.0 } else { value(row, 16) };
        if !(0.0..N_RINGS).contains(&ring) || ring.fract() != 0.0 {
            return Err(NuscenesError::Ring { index, ring });
        }
        Ok((point, ring as u8))
    };
    rows.iter().enumerate().map(point).collect()
}

/// Content of a file with these points, the inverse of [`points_from_bin`].
pub fn bin_from_points(points: &[(CloudPoint, u8)]) -> Vec<u8> {
    let values = |(p, ring): &(CloudPoint, u8)| [p.x, p.y, p.z, p.intensity, f32::from(*ring)];
    points.iter().flat_map(values).flat_map(f32::to_le_bytes).collect()
}

/// Parts of a file name: `<log>__LIDAR_TOP__<microseconds>.pcd.bin`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SweepName {
    /// Name of the drive.
    pub log: String,
    /// End of the revolution: the time to which its points are motion-compensated.
    pub end: Stamp,
}

impl SweepName {
    /// Parses a file name; `None` for other names.
    pub fn parse(name: &str) -> Option<Self> {
        let (log, rest) = name.strip_suffix(".pcd.bin")?.split_once("__LIDAR_TOP__")?;
        let micros: i64 = rest.parse().ok().filter(|micros| *micros >= 0)?;
        Some(Self { log: log.to_owned(), end: Stamp(micros.checked_mul(1000)?) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_survive_round_trip() {
        let points: Vec<(CloudPoint, u8)> =
            (0..32).map(|i| (CloudPoint { x: f32::from(i), y: -0.5, z: 1e-9, intensity: 255.0 }, i)).collect();
        let bytes = bin_from_points(&points);
        assert_eq!(points_from_bin(&bytes), Ok(points));
        assert_eq!(points_from_bin(&bytes[..30]), Err(NuscenesError::Size { n_bytes: 30 }));
        // A missing return has no ring.
        let missing = points_from_bin(&[f32::NAN; 5].map(f32::to_le_bytes).concat()).expect("reads");
        assert!(missing[0].0.x.is_nan() && missing[0].1 == 0);
        for ring in [-1.0_f32, 32.0, 0.5] {
            let bytes = [&[0; 16][..], &ring.to_le_bytes()].concat();
            assert_eq!(points_from_bin(&bytes), Err(NuscenesError::Ring { index: 0, ring }));
        }
    }

    #[test]
    fn name_has_log_and_end_of_the_revolution() {
        let name = "n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";
        let log = "n015-2018-07-24-11-22-45+0800".to_owned();
        assert_eq!(SweepName::parse(name), Some(SweepName { log, end: Stamp(1_532_402_927_647_951_000) }));
        assert_eq!(SweepName::parse("000000.bin"), None);
    }

    #[real_data::test("nuscenes/*.pcd.bin")]
    fn rings_of_real_sweep_are_ranks_by_elevation() {
        let points = real_sweep();
        assert_eq!(points.len(), 34_688);
        // Points are motion-compensated by up to half a meter: nearer ones change their elevation.
        let far = points.iter().filter(|(p, _)| p.x.hypot(p.y) > 10.0);
        let returns: Vec<(f32, f32)> = far
            .map(|(p, ring)| (p.z.atan2(p.x.hypot(p.y)).to_degrees(), f32::from(*ring) * 4.0 / 3.0 - 30.67))
            .collect();
        let n_near = returns.iter().filter(|(found, nominal)| (found - nominal).abs() < 0.4).count();
        assert!(returns.len() > 10_000 && n_near * 100 > returns.len() * 99, "{n_near} of {}", returns.len());
    }
    /// A beam keeps its elevation, so the elevation of a point shows how far it was moved along y: by the motion of the
    /// vehicle from its shot to the time of the sweep. The sensor turns clockwise and begins its revolutions on the left,
    /// slightly to the rear.
    #[real_data::test("nuscenes/*.pcd.bin")]
    fn real_sweep_is_compensated_to_the_end_of_its_revolution() {
        let moved_m = |clockwise_deg: f32| {
            let mut found: Vec<f32> = Vec::new();
            for (p, ring) in real_sweep().iter().filter(|(p, ring)| *ring < 14 && p.x.hypot(p.y) > 2.5) {
                let azimuth = p.x.atan2(p.y).to_degrees();
                let range = p.z / (f32::from(*ring) * 4.0 / 3.0 - 30.67).to_radians().tan();
                let y = (range * range - p.x * p.x).sqrt().copysign(p.y);
                if (azimuth - clockwise_deg).abs() < 5.0 && y.is_finite() {
                    found.push(y - p.y);
                }
            }
            assert!(found.len() > 100, "{} points", found.len());
            found.sort_by(f32::total_cmp);
            found[found.len() / 2]
        };
        // Half a meter at the start, a third of that at the rear, zero at the end.
        let [begin, front, rear, end] = [-70.0, 0.0, 180.0 - 6.0, -115.0].map(moved_m);
        assert!(
            begin > 0.4 && begin > front && front > rear && rear > end && end < 0.03,
            "{begin} {front} {rear} {end}"
        );
    }

    fn real_sweep() -> Vec<(CloudPoint, u8)> {
        let folder = real_data::path("nuscenes").read_dir().expect("lists");
        let mut paths = folder.map(|entry| entry.expect("is there").path());
        let path = paths.find(|path| path.to_string_lossy().ends_with(".pcd.bin")).expect("a sweep");
        points_from_bin(&std::fs::read(path).expect("reads")).expect("decodes")
    }
}
