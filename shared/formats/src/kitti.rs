//! KITTI (Geiger et al., CVPR 2012) and SemanticKITTI (Behley et al., ICCV 2019): little-endian rows without header.
//!
//! A sweep `.bin` has x y z remission as f32, 16 bytes per point, in the lidar frame (x forward, y left, z up), remission 0 to 1.
//! A `.label` has one u32 per point: class in the low, instance in the high 16 bits.

use crate::cloud::CloudPoint;

/// Error of a file whose size is not a multiple of the row size.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("{n_bytes} bytes are not a multiple of the row size, {row} bytes")]
pub struct KittiError {
    /// Size of the file.
    pub n_bytes: usize,
    /// Size of a row.
    pub row: usize,
}

/// The points of a sweep.
pub fn points_from_bin(bytes: &[u8]) -> Result<Vec<CloudPoint>, KittiError> {
    let rows = rows::<16>(bytes)?;
    let value = |row: &[u8; 16], at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
    let point = |row| CloudPoint { x: value(row, 0), y: value(row, 4), z: value(row, 8), intensity: value(row, 12) };
    Ok(rows.map(point).collect())
}

/// Content of a file with these points, the inverse of [`points_from_bin`].
pub fn bin_from_points(points: &[CloudPoint]) -> Vec<u8> {
    points.iter().flat_map(|p| [p.x, p.y, p.z, p.intensity]).flat_map(f32::to_le_bytes).collect()
}

/// The label of every point.
pub fn labels_from_bytes(bytes: &[u8]) -> Result<Vec<Label>, KittiError> {
    Ok(rows::<4>(bytes)?
        .map(|row| Label {
            class: u16::from_le_bytes([row[0], row[1]]),
            instance: u16::from_le_bytes([row[2], row[3]]),
        })
        .collect())
}

/// Content of a file with these labels, the inverse of [`labels_from_bytes`].
pub fn bytes_from_labels(labels: &[Label]) -> Vec<u8> {
    labels.iter().flat_map(|label| [label.class, label.instance]).flat_map(u16::to_le_bytes).collect()
}

/// Class and instance of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Label {
    /// Class in the numbering of the data set.
    pub class: u16,
    /// Instance, 0 = none.
    pub instance: u16,
}

fn rows<const N: usize>(bytes: &[u8]) -> Result<impl Iterator<Item = &[u8; N]>, KittiError> {
    let (rows, rest) = bytes.as_chunks::<N>();
    if rest.is_empty() { Ok(rows.iter()) } else { Err(KittiError { n_bytes: bytes.len(), row: N }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_survive_round_trip() {
        let points: Vec<CloudPoint> =
            (0..9).map(|i| CloudPoint { x: i as f32, y: -0.5, z: 1e-9, intensity: 0.25 * i as f32 }).collect();
        let bytes = bin_from_points(&points);
        assert_eq!(points_from_bin(&bytes), Ok(points));
        assert_eq!(points_from_bin(&bytes[..143]), Err(KittiError { n_bytes: 143, row: 16 }));
        let labels = [Label { class: 10, instance: 65_535 }, Label { class: 259, instance: 1 }];
        assert_eq!(bytes_from_labels(&labels), [10, 0, 255, 255, 3, 1, 1, 0]);
        assert_eq!(labels_from_bytes(&bytes_from_labels(&labels)).as_deref(), Ok(&labels[..]));
    }

    #[real_data::test("kitti00/000094.bin")]
    fn real_sweep_is_read() {
        let path = real_data::path("kitti00/000094.bin");
        let points = points_from_bin(&std::fs::read(path).expect("reads")).expect("decodes");
        assert_eq!(points.len(), 121_618);
        assert!(points.iter().all(|p| p.x.hypot(p.y) < 100.0 && (0.0..=1.0).contains(&p.intensity)));
        // The road lies 1.7 m below the sensor.
        let n_road = points.iter().filter(|p| p.x.abs() < 15.0 && p.y.abs() < 4.0 && (p.z + 1.7).abs() < 0.3).count();
        assert!(n_road > 20_000, "{n_road}");
    }
}
