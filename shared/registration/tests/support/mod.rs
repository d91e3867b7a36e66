//! Inputs for the tests and the bench: real sweeps from files, and a synthetic drive with its truth.

#![allow(dead_code, reason = "each test uses its own part")]
#![allow(missing_docs, reason = "not part of the library")]
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

pub mod world;

use geometry::{Isometry3, Pose, Stamp, Translation3, UnitQuaternion};
use nalgebra::{Matrix3, Rotation3, Vector3};
use registration::{Sweep, TimedPoint};
use std::path::Path;

/// Sweep without point times and rings, `number` tenths of a second after the epoch.
pub fn untimed(points: &[[f32; 4]], number: usize) -> Sweep {
    let point = |p: &[f32; 4]| TimedPoint { position: [p[0], p[1], p[2]], offset_nanos: 0, ring: 0 };
    Sweep::new(Stamp(number as i64 * 100_000_000), points.iter().map(point).collect(), 0)
}

/// x y z intensity of a binary PCD file with just these fields.
pub fn read_pcd(path: &Path) -> Vec<[f32; 4]> {
    let bytes = std::fs::read(path).unwrap();
    let marker = b"DATA binary\n";
    let start = bytes.windows(marker.len()).position(|window| window == marker).unwrap() + marker.len();
    assert!(String::from_utf8_lossy(&bytes[..start]).contains("FIELDS x y z intensity"));
    quads(&bytes[start..])
}

/// x y z intensity of a KITTI .bin file.
pub fn read_bin(path: &Path) -> Vec<[f32; 4]> {
    quads(&std::fs::read(path).unwrap())
}

fn quads(bytes: &[u8]) -> Vec<[f32; 4]> {
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    bytes.chunks_exact(16).map(|b| [number(b), number(&b[4..]), number(&b[8..]), number(&b[12..])]).collect()
}

/// Rows of 12 numbers, 3x4 row-major.
pub fn read_kitti_poses(path: &Path) -> Vec<Pose> {
    let pose = |line: &str| {
        let v: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let rotation = Matrix3::new(v[0], v[1], v[2], v[4], v[5], v[6], v[8], v[9], v[10]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
        Isometry3::from_parts(Translation3::from(Vector3::new(v[3], v[7], v[11])), rotation)
    };
    std::fs::read_to_string(path).unwrap().lines().map(pose).collect()
}

pub fn path_length(poses: &[Pose]) -> f64 {
    poses.windows(2).map(|pair| (pair[1].translation.vector - pair[0].translation.vector).norm()).sum()
}
