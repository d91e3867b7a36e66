//! Inputs of the tests: real sweeps from files, and a synthetic drive with ground truth.

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

/// Reads x y z intensity from a PCD file.
pub fn read_pcd(path: &Path) -> Vec<[f32; 4]> {
    quads(&formats::pcd::points_from_pcd(&std::fs::read(path).unwrap()).unwrap())
}

/// Reads x y z intensity from a KITTI .bin file.
pub fn read_bin(path: &Path) -> Vec<[f32; 4]> {
    quads(&formats::kitti::points_from_bin(&std::fs::read(path).unwrap()).unwrap())
}

fn quads(points: &[formats::cloud::CloudPoint]) -> Vec<[f32; 4]> {
    points.iter().map(|point| [point.x, point.y, point.z, point.intensity]).collect()
}

/// Reads poses from rows of 12 numbers, 3x4 row-major.
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
