//! Sweeps in the layout of SemanticKITTI (Behley et al., ICCV 2019), which training code can read.

use crate::cloud::{self, CloudPoint};
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use files::atomic_file::write_atomic;
use formats::cloud::CloudPoint as KittiPoint;
use formats::kitti::{Label, bin_from_points, bytes_from_labels};
use formats::trajectory::{kitti_from_trajectory, times_from_trajectory};
use geometry::{Isometry3, Point3, Pose, Stamp, Trajectory, Translation3, UnitQuaternion, Vector3};
use messages::ClassId;
use std::collections::BTreeMap;
use std::path::Path;

/// Placeholder projection for a missing camera, and the identity from the LiDAR to it: the poses are LiDAR poses.
const CALIB: &str = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nP1: 1 0 0 0 0 1 0 0 0 0 1 0\nP2: 1 0 0 0 0 1 0 0 0 0 1 0\n\
                     P3: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n";

/// Writes the sweeps of a run into the existing folder `out`, the folder of a sequence. Returns the number of sweeps.
///
/// The frame of a sweep has its origin at the LiDAR at the first shot, and the axes of the body (forward, left, up).
/// Sweeps are deskewed. Points without finite coordinates are left out.
pub fn write_semantic_kitti(run: &RunFolder, out: &Path) -> Result<usize, DeliverError> {
    let velodyne = out.join("velodyne");
    let labels = out.join("labels");
    for folder in [&velodyne, &labels] {
        std::fs::create_dir_all(folder).map_err(DeliverError::file(folder, "create"))?;
    }
    let clouds = cloud::open_all(std::slice::from_ref(run))?.clouds;
    let begin_nanos = run.begin_nanos().unwrap_or(0);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), run.convergence());
    let mut poses = Trajectory::default();
    let mut n_sweeps = 0;
    for cloud in &clouds {
        // A submap contains whole sweeps.
        let mut sweeps: BTreeMap<u32, Vec<CloudPoint>> = BTreeMap::new();
        cloud.each_block(|_, rows| {
            for row in rows.chunks_exact(cloud.columns.row_size()) {
                let point = cloud.columns.point(row);
                if point.xyz.iter().all(|value| value.is_finite()) {
                    sweeps.entry(point.frame).or_default().push(point);
                }
            }
            Ok(())
        })?;
        for points in sweeps.values() {
            let Some(sweep) = Sweep::new(points, &run.trajectory, &turn) else { continue };
            poses.push(Stamp(sweep.stamp.0 - begin_nanos), sweep.world_from_sweep);
            let write = |folder: &Path, extension: &str, content: Vec<u8>| {
                let path = folder.join(format!("{n_sweeps:06}.{extension}"));
                std::fs::write(&path, content).map_err(DeliverError::file(&path, "write"))
            };
            write(&velodyne, "bin", bin_from_points(&sweep.points(points)))?;
            write(&labels, "label", bytes_from_labels(&points.iter().map(label).collect::<Vec<_>>()))?;
            n_sweeps += 1;
        }
    }
    let texts = [
        ("poses.txt", kitti_from_trajectory(&relative_to_first(&poses))),
        ("times.txt", times_from_trajectory(&poses)),
        ("calib.txt", CALIB.to_owned()),
    ];
    for (name, text) in texts {
        let path = out.join(name);
        write_atomic(&path, text.as_bytes()).map_err(DeliverError::file(&path, "write"))?;
    }
    Ok(n_sweeps)
}

/// Poses relative to the first one: KITTI poses start with the identity.
fn relative_to_first(poses: &Trajectory) -> Trajectory {
    let mut relative = Trajectory::default();
    if let Some((_, first)) = poses.poses().first() {
        for (stamp, pose) in poses.poses() {
            relative.push(*stamp, first.inverse() * pose);
        }
    }
    relative
}

/// Frame of a sweep.
struct Sweep {
    stamp: Stamp,
    world_from_sweep: Pose,
}

impl Sweep {
    /// The frame at the first shot. `None` without points.
    fn new(points: &[CloudPoint], trajectory: &Trajectory, turn: &UnitQuaternion<f64>) -> Option<Self> {
        let first = points.iter().min_by(|a, b| a.time_s.total_cmp(&b.time_s))?;
        let stamp = Stamp::from_seconds(first.time_s);
        // Rounding may place the time of the first shot before the first pose.
        let begin = trajectory.poses().first()?.0;
        let end = trajectory.poses().last()?.0;
        let world_from_body = trajectory.at(stamp.clamp(begin, end))?;
        let origin = Translation3::from(Vector3::from(first.lidar_xyz));
        Some(Self { stamp, world_from_sweep: Isometry3::from_parts(origin, turn * world_from_body.rotation) })
    }

    fn points(&self, points: &[CloudPoint]) -> Vec<KittiPoint> {
        let sweep_from_world = self.world_from_sweep.inverse();
        let point = |point: &CloudPoint| {
            let [x, y, z] = (sweep_from_world * Point3::from(point.xyz)).coords.map(|value| value as f32).into();
            KittiPoint { x, y, z, intensity: f32::from(point.intensity) / 255.0 }
        };
        points.iter().map(point).collect()
    }
}

fn label(point: &CloudPoint) -> Label {
    let class = ClassId::from_id(point.class).unwrap_or(ClassId::Unlabeled);
    // The data set stores instances in 16 bits.
    Label { class: label_of_class(class, point.is_moving), instance: point.instance as u16 }
}

/// Id in SemanticKITTI label files. Classes that SemanticKITTI does not define become "other structure" or "other
/// object".
fn label_of_class(class: ClassId, is_moving: bool) -> u16 {
    match (class, is_moving) {
        (ClassId::Unlabeled | ClassId::Sky | ClassId::Water, _) => 0,
        (ClassId::Vehicles, false) => 10,
        (ClassId::Vehicles, true) => 252,
        (ClassId::Pedestrian, false) => 30,
        (ClassId::Pedestrian, true) => 254,
        (ClassId::Road, _) => 40,
        (ClassId::Sidewalk, _) => 48,
        (ClassId::Ground | ClassId::RailTrack, _) => 49,
        (ClassId::Building, _) => 50,
        (ClassId::Fence | ClassId::GuardRail, _) => 51,
        (ClassId::Wall | ClassId::Bridge, _) => 52,
        (ClassId::RoadLine, _) => 60,
        (ClassId::Vegetation, _) => 70,
        (ClassId::Terrain, _) => 72,
        (ClassId::Pole, _) => 80,
        (ClassId::TrafficSign, _) => 81,
        (ClassId::Other | ClassId::TrafficLight | ClassId::Static | ClassId::Dynamic, _) => 99,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::semantic_kitti::class_of_label;

    #[test]
    fn classes_of_the_data_set_survive_round_trip() {
        for class in ClassId::ALL.iter().copied() {
            for is_moving in [false, true] {
                let back = class_of_label(label_of_class(class, is_moving)).expect("is defined");
                let expected = match class {
                    ClassId::GuardRail => ClassId::Fence,
                    ClassId::RailTrack => ClassId::Ground,
                    ClassId::Sky
                    | ClassId::Water
                    | ClassId::Wall
                    | ClassId::Bridge
                    | ClassId::Other
                    | ClassId::TrafficLight
                    | ClassId::Static
                    | ClassId::Dynamic => ClassId::Unlabeled,
                    other => other,
                };
                assert_eq!(back, expected, "{}", class.name());
            }
        }
    }
}
