//! Reader of one nuScenes sample.

use geometry::{Isometry3, Pose, Translation3, UnitQuaternion};
use image::RgbImage;
use messages::SubmapPoint;
use nalgebra::{Matrix3, Matrix4, Point3, Rotation3};
use serde_json::Value;
use std::path::Path;

pub struct Camera {
    pub name: String,
    pub picture: RgbImage,
    pub stamp: i64,
    pub camera_from_lidar: Matrix4<f64>,
    pub image_from_camera: Matrix3<f64>,
    pub body_from_camera: Pose,
}

/// A labeled car or truck.
pub struct Vehicle {
    /// Center in the LiDAR frame, m.
    pub center: [f64; 3],
    /// Length, width and height, m.
    pub size: [f64; 3],
    /// Rotation about the z axis of the LiDAR, rad.
    pub yaw: f64,
}

impl Vehicle {
    /// Whether the point is in the box.
    pub fn holds(&self, point: &SubmapPoint) -> bool {
        let [x, y, z] = [point.x, point.y, point.z].map(f64::from);
        let [dx, dy, dz] = [x - self.center[0], y - self.center[1], z - self.center[2]];
        let (sine, cosine) = self.yaw.sin_cos();
        let along = dx * cosine + dy * sine;
        let across = dy * cosine - dx * sine;
        let [length, width, height] = self.size.map(|side| 0.5 * side);
        along.abs() < length && across.abs() < width && dz.abs() < height
    }
}

pub struct NuScenesSample {
    pub world_from_lidar: Pose,
    pub body_from_lidar: Pose,
    pub stamp: i64,
    pub points: Vec<SubmapPoint>,
    pub cameras: Vec<Camera>,
    pub boxes: Vec<Vehicle>,
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn stamp(value: &Value) -> i64 {
    // The data set has a resolution of microseconds.
    (number(value) * 1e6).round() as i64 * 1000
}

fn matrix4(value: &Value) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| number(&value[i][j]))
}

pub fn pose(matrix: &Matrix4<f64>) -> Pose {
    // The file has seven digits: the matrix is not exactly a rotation.
    let rotation = Rotation3::from_matrix(&matrix.fixed_view::<3, 3>(0, 0).into_owned());
    let translation = Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
}

fn read_points(path: &Path) -> Vec<SubmapPoint> {
    let bytes = std::fs::read(path).expect("readable");
    let numbers: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect();
    let point = |row: &[f32; 5]| SubmapPoint {
        x: row[0],
        y: row[1],
        z: row[2],
        intensity: row[3] as u8,
        ring: row[4] as u8,
        ..SubmapPoint::default()
    };
    numbers.as_chunks::<5>().0.iter().map(point).collect()
}

pub fn read_sample(folder: &Path) -> NuScenesSample {
    let text = std::fs::read_to_string(folder.join("calib_and_boxes.json")).expect("readable");
    // The boxes have velocities of NaN, which is not JSON; they are not used here.
    let json: Value = serde_json::from_str(&text.replace("NaN", "null")).expect("JSON");
    let camera = |(name, entry): (&String, &Value)| Camera {
        name: name.clone(),
        picture: image::open(folder.join(entry["img_path"].as_str().expect("a path"))).expect("a JPEG").to_rgb8(),
        stamp: stamp(&entry["timestamp"]),
        camera_from_lidar: matrix4(&entry["lidar2cam"]),
        image_from_camera: Matrix3::from_fn(|i, j| number(&entry["cam2img"][i][j])),
        body_from_camera: pose(&matrix4(&entry["cam2ego"])),
    };
    let vehicle = |entry: &Value| {
        let [x, y, z, length, width, height, yaw] = std::array::from_fn(|i| number(&entry["bbox_3d"][i]));
        Vehicle { center: [x, y, z], size: [length, width, height], yaw }
    };
    // 0 is a car, 1 a truck.
    let are_vehicles = |entry: &&Value| matches!(entry["bbox_label_3d"].as_i64(), Some(0 | 1));
    let body_from_lidar = pose(&matrix4(&json["lidar_points"]["lidar2ego"]));
    NuScenesSample {
        world_from_lidar: pose(&matrix4(&json["ego2global"])) * body_from_lidar,
        body_from_lidar,
        stamp: stamp(&json["timestamp"]),
        points: read_points(&folder.join(json["lidar_points"]["lidar_path"].as_str().expect("a path"))),
        cameras: json["images"].as_object().expect("cameras").iter().map(camera).collect(),
        boxes: json["instances"].as_array().expect("boxes").iter().filter(are_vehicles).map(vehicle).collect(),
    }
}

pub fn pixel(camera: &Camera, point: &SubmapPoint) -> Option<(f64, f64)> {
    let p = camera.camera_from_lidar.transform_point(&Point3::new(point.x, point.y, point.z).cast());
    let h = camera.image_from_camera * p.coords;
    let u = h.x / h.z;
    let v = h.y / h.z;
    let (width, height) = camera.picture.dimensions();
    (h.z > 1e-3 && u > -0.5 && v > -0.5 && u < f64::from(width) - 0.5 && v < f64::from(height) - 0.5).then_some((u, v))
}
