//! Calibration files of KITTI raw (`calib_*.txt` of a day) and KITTI odometry (`calib.txt` of a sequence), for rectified images.

use super::{CameraPart, RigParts, SourceOptions, pose_of_matrix, text};
use crate::error::RigError;
use geometry::{CameraModel, Pinhole, Pose, Translation3};
use std::collections::BTreeMap;
use std::path::Path;

/// Names of KITTI's cameras in their order.
const CAMERAS: [&str; 4] = ["gray_left", "gray_right", "color_left", "color_right"];

/// Lines `key: numbers` of a file.
type Table = BTreeMap<String, Vec<f64>>;

pub(super) fn read(folder: &Path, options: &SourceOptions) -> Result<RigParts, RigError> {
    let odometry = folder.join("calib.txt");
    if odometry.is_file() {
        return read_odometry(&odometry, options);
    }
    let cameras = folder.join("calib_cam_to_cam.txt");
    if cameras.is_file() {
        return read_raw(folder, &cameras, options);
    }
    let rule = "has no calibration of KITTI; must have calib.txt (odometry), or calib_cam_to_cam.txt and calib_velo_to_cam.txt (raw)";
    Err(RigError::source(folder, "", rule))
}

fn table(path: &Path) -> Result<Table, RigError> {
    let mut table = Table::new();
    for (index, line) in text(path)?.lines().enumerate() {
        let Some((key, rest)) = line.split_once(':') else { continue };
        // Dates and other words are not numbers.
        let numbers: Option<Vec<f64>> =
            rest.split_whitespace().map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect();
        if let Some(numbers) = numbers {
            table.insert(key.trim().to_owned(), numbers);
        } else if key.starts_with(['P', 'R', 'T', 'S']) {
            return Err(RigError::source(
                path,
                &format!("line {}", index + 1),
                format!("{key} must be finite numbers"),
            ));
        }
    }
    Ok(table)
}

fn numbers<'a>(path: &Path, table: &'a Table, key: &str, n: usize) -> Result<&'a [f64], RigError> {
    let found = table.get(key).ok_or_else(|| RigError::source(path, "", format!("has no {key}")))?;
    if found.len() != n {
        return Err(RigError::source(path, key, format!("{} numbers; must be {n}", found.len())));
    }
    Ok(found)
}

/// The body is the LiDAR unless the source frame, which is the LiDAR's frame, is mounted otherwise.
fn read_odometry(path: &Path, options: &SourceOptions) -> Result<RigParts, RigError> {
    let table = table(path)?;
    let key = if table.contains_key("Tr") { "Tr" } else { "Tr_velo_to_cam" };
    let rectified_from_lidar = pose(path, key, numbers(path, &table, key, 12)?)?;
    let Some(size) = options.image_size else {
        let rule = "calib.txt has no size of the images; give --image-size W,H (1241,376 for sequence 00)";
        return Err(RigError::source(path, "", rule));
    };
    let sizes = [Some(size); 4];
    let mut parts = cameras(path, &table, ["P0", "P1", "P2", "P3"], sizes, &rectified_from_lidar, options)?;
    parts.notes.push("KITTI odometry; frame of the source and body: the LiDAR".to_owned());
    Ok(parts)
}

/// The body is the inertial unit if the folder has `calib_imu_to_velo.txt`, otherwise the LiDAR.
fn read_raw(folder: &Path, path: &Path, options: &SourceOptions) -> Result<RigParts, RigError> {
    let of_cameras = table(path)?;
    let lidar_path = folder.join("calib_velo_to_cam.txt");
    let camera_from_lidar = rigid(&lidar_path)?;
    let rectifying = numbers(path, &of_cameras, "R_rect_00", 9)?;
    let rectifying = crate::rotation::from_matrix(&nalgebra::Matrix3::from_row_slice(rectifying))
        .map_err(|error| RigError::source(path, "R_rect_00", error.to_string()))?;
    let rectified_from_lidar = Pose::from_parts(Translation3::identity(), rectifying) * camera_from_lidar;
    let size = |camera: usize| {
        let side = of_cameras.get(&format!("S_rect_0{camera}"))?;
        let [width, height] = side[..] else { return None };
        Some([width as u32, height as u32])
    };
    let sizes = [0, 1, 2, 3].map(|camera| size(camera).or(options.image_size));
    let keys = ["P_rect_00", "P_rect_01", "P_rect_02", "P_rect_03"];
    let imu_path = folder.join("calib_imu_to_velo.txt");
    if !imu_path.is_file() {
        let mut parts = cameras(path, &of_cameras, keys, sizes, &rectified_from_lidar, options)?;
        parts.notes.push("KITTI raw without calib_imu_to_velo.txt; frame of the source and body: the LiDAR".to_owned());
        return Ok(parts);
    }
    let body_from_imu = options.body_from_source.unwrap_or_else(Pose::identity);
    let body_from_lidar = body_from_imu * rigid(&imu_path)?.inverse();
    let of_lidar = SourceOptions { body_from_source: Some(body_from_lidar), ..options.clone() };
    let mut parts = cameras(path, &of_cameras, keys, sizes, &rectified_from_lidar, &of_lidar)?;
    parts.body_from_imu = Some(body_from_imu);
    parts.antenna_in_body = Some(body_from_imu.translation.vector.into());
    parts.notes.push(
        "KITTI raw; frame of the source and body: the inertial unit, which is also the reference of the fixes"
            .to_owned(),
    );
    Ok(parts)
}

/// Pose from R and T of a file.
fn rigid(path: &Path) -> Result<Pose, RigError> {
    let table = table(path)?;
    let rotation = numbers(path, &table, "R", 9)?;
    let position = numbers(path, &table, "T", 3)?;
    let row = |row: usize| [rotation[3 * row], rotation[3 * row + 1], rotation[3 * row + 2], position[row]];
    pose(path, "R, T", &[row(0), row(1), row(2)].concat())
}

fn pose(path: &Path, key: &str, numbers: &[f64]) -> Result<Pose, RigError> {
    pose_of_matrix(numbers).map_err(|rule| RigError::source(path, key, rule))
}

/// The cameras from rectified projection matrices: K [I | t], where t is the position of the first camera in the frame
/// of each.
fn cameras(
    path: &Path,
    table: &Table,
    keys: [&str; 4],
    sizes: [Option<[u32; 2]>; 4],
    rectified_from_lidar: &Pose,
    options: &SourceOptions,
) -> Result<RigParts, RigError> {
    let body_from_lidar = options.body_from_source.unwrap_or_else(Pose::identity);
    let mut parts = RigParts { body_from_lidar: Some(body_from_lidar), ..RigParts::default() };
    for ((key, name), size) in keys.into_iter().zip(CAMERAS).zip(sizes) {
        if !table.contains_key(key) {
            parts.notes.push(format!("{key} is missing: no camera {name}"));
            continue;
        }
        let p = numbers(path, table, key, 12)?;
        let fx = p[0];
        let cx = p[2];
        let fy = p[5];
        let cy = p[6];
        if !(fx > 0.0 && fy > 0.0) || p[8..11] != [0.0, 0.0, 1.0] {
            let rule = "is not a projection of a rectified camera; must be fx 0 cx tx, 0 fy cy ty, 0 0 1 tz";
            return Err(RigError::source(path, key, rule));
        }
        let Some([width, height]) = size else {
            return Err(RigError::source(path, key, "the size of its images is not known; give --image-size W,H"));
        };
        let z = p[11];
        let camera_from_rectified = Translation3::new((p[3] - cx * z) / fx, (p[7] - cy * z) / fy, z);
        let camera_from_lidar = camera_from_rectified * rectified_from_lidar;
        parts.cameras.push(CameraPart {
            name: name.to_owned(),
            frame: None,
            body_from_camera: Some(body_from_lidar * camera_from_lidar.inverse()),
            model: CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] }),
        });
    }
    Ok(parts)
}
