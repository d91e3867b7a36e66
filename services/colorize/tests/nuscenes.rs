//! One real HDL-32E sweep and the six cameras around it (nuScenes), with the data set's own calibration.
//!
//! The truth is computed here along another way: the data set's composed `camera_from_lidar` and intrinsic matrices,
//! which know nothing of stamps, trajectories and rigs.

mod common;

use colorize::{Colorize, Settings};
use common::{bare_manifest, camera, drive, stamped, submap};
use formats::manifest::PoseEntry;
use geometry::{CameraModel, Isometry3, Pinhole, Pose, Translation3, UnitQuaternion};
use image::RgbImage;
use messages::{Color, ColorRow, Image, ImageHeader, NoHeader, Submap, SubmapPoint, Trajectory, UNSEEN};
use nalgebra::{Matrix3, Matrix4, Point3, Rotation3};
use serde_json::Value;
use stage::testing::{Bench, context};
use std::path::Path;

struct Camera {
    name: String,
    picture: RgbImage,
    stamp: i64,
    camera_from_lidar: Matrix4<f64>,
    image_from_camera: Matrix3<f64>,
    body_from_camera: Pose,
}

struct Scene {
    world_from_lidar: Pose,
    body_from_lidar: Pose,
    stamp: i64,
    points: Vec<SubmapPoint>,
    cameras: Vec<Camera>,
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn stamp(value: &Value) -> i64 {
    // Microseconds are what the recording has.
    (number(value) * 1e6).round() as i64 * 1000
}

fn matrix4(value: &Value) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| number(&value[i][j]))
}

fn pose(matrix: &Matrix4<f64>) -> Pose {
    // The file has seven digits, which is not quite a rotation.
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

fn read_scene(folder: &Path) -> Scene {
    let text = std::fs::read_to_string(folder.join("calib_and_boxes.json")).expect("readable");
    // The boxes have velocities of NaN, which is not JSON; none of them is used here.
    let json: Value = serde_json::from_str(&text.replace("NaN", "null")).expect("JSON");
    let camera = |(name, entry): (&String, &Value)| Camera {
        name: name.clone(),
        picture: image::open(folder.join(entry["img_path"].as_str().expect("a path"))).expect("a JPEG").to_rgb8(),
        stamp: stamp(&entry["timestamp"]),
        camera_from_lidar: matrix4(&entry["lidar2cam"]),
        image_from_camera: Matrix3::from_fn(|i, j| number(&entry["cam2img"][i][j])),
        body_from_camera: pose(&matrix4(&entry["cam2ego"])),
    };
    let body_from_lidar = pose(&matrix4(&json["lidar_points"]["lidar2ego"]));
    Scene {
        world_from_lidar: pose(&matrix4(&json["ego2global"])) * body_from_lidar,
        body_from_lidar,
        stamp: stamp(&json["timestamp"]),
        points: read_points(&folder.join(json["lidar_points"]["lidar_path"].as_str().expect("a path"))),
        cameras: json["images"].as_object().expect("cameras").iter().map(camera).collect(),
    }
}

/// Runs the stage; `delay_nanos` falsifies the stamps of all images.
fn colors(scene: &Scene, delay_nanos: i64) -> Vec<ColorRow> {
    let mut manifest = bare_manifest();
    manifest.lidar.body_from_lidar = PoseEntry::from(scene.body_from_lidar);
    for entry in &scene.cameras {
        let k = entry.image_from_camera;
        let (fx, fy, cx, cy) = (k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]);
        let (width, height) = entry.picture.dimensions();
        let model = CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] });
        manifest.cameras.push(camera(&entry.name, entry.body_from_camera, model));
    }
    let folder = drive(&manifest);
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");

    // The vehicle's pose at each exposure is contained in the composed matrices.
    let mut poses = vec![(scene.stamp, scene.world_from_lidar * scene.body_from_lidar.inverse())];
    for entry in &scene.cameras {
        let world_from_camera = scene.world_from_lidar * pose(&entry.camera_from_lidar).inverse();
        poses.push((entry.stamp, world_from_camera * entry.body_from_camera.inverse()));
    }
    poses.sort_by_key(|(stamp, _)| *stamp);
    // The vehicle goes on as it went, for exposures that pretend to be later.
    let (a, b) = (poses[0], poses[poses.len() - 1]);
    poses.push((2 * b.0 - a.0, b.1 * a.1.inverse() * b.1));
    let rows = poses.iter().map(|(stamp, pose)| stamped(*stamp, *pose)).collect();
    bench.send::<Trajectory>(scene.stamp, NoHeader::default(), rows);
    for (index, entry) in scene.cameras.iter().enumerate() {
        let (width, height) = entry.picture.dimensions();
        let header = ImageHeader { camera: index as u32, width, height, channels: 3, exposure_nanos: 5_000_000 };
        bench.send::<Image>(entry.stamp + delay_nanos, header, entry.picture.as_raw().clone());
    }
    let header = submap(scene.world_from_lidar, scene.stamp, &scene.points);
    bench.send::<Submap>(scene.stamp, header, scene.points.clone());
    bench.tick().expect("a tick");
    bench.finish().expect("an end");
    bench.take::<Color>()[0].rows().to_vec()
}

fn pixel(camera: &Camera, point: &SubmapPoint) -> Option<(f64, f64)> {
    let p = camera.camera_from_lidar.transform_point(&Point3::new(point.x, point.y, point.z).cast());
    let h = camera.image_from_camera * p.coords;
    let (u, v) = (h.x / h.z, h.y / h.z);
    let (width, height) = camera.picture.dimensions();
    (h.z > 1e-3 && u > -0.5 && v > -0.5 && u < f64::from(width) - 0.5 && v < f64::from(height) - 0.5).then_some((u, v))
}

/// Largest difference of a channel between the point's color and the picture at the pixel, between pixel centers.
fn difference(picture: &RgbImage, (u, v): (f64, f64), row: ColorRow) -> f64 {
    let clamp = |at: f64, len: u32| at.clamp(0.0, f64::from(len - 1));
    let (u, v) = (clamp(u, picture.width()), clamp(v, picture.height()));
    let colors = [row.r, row.g, row.b];
    let at = |x: f64, y: f64, i: usize| {
        let (x, y) = ((x as u32).min(picture.width() - 1), (y as u32).min(picture.height() - 1));
        f64::from(picture.get_pixel(x, y)[i])
    };
    let mixed = |i: usize| {
        let (a, b) = (u.fract(), v.fract());
        let top = (1.0 - a) * at(u, v, i) + a * at(u + 1.0, v, i);
        (1.0 - b) * top + b * ((1.0 - a) * at(u, v + 1.0, i) + a * at(u + 1.0, v + 1.0, i))
    };
    (0..3).map(|i| (mixed(i) - f64::from(colors[i])).abs()).fold(0.0, f64::max)
}

#[test]
fn a_real_sweep_gets_the_colors_of_six_real_images() {
    let Some(folder) = real_data::real_data("nuscenes") else { return };
    let scene = read_scene(&folder);
    assert_eq!((scene.points.len(), scene.cameras.len()), (34_688, 6));
    let colors = colors(&scene, 0);
    write_pictures(&scene, &colors);

    let mut n_seen = [0; 6];
    let (mut n_off, mut n_visible) = (0, 0);
    for (point, row) in scene.points.iter().zip(&colors) {
        let visible: Vec<Option<(f64, f64)>> = scene.cameras.iter().map(|camera| pixel(camera, point)).collect();
        n_visible += usize::from(visible.iter().any(Option::is_some));
        if row.camera == UNSEEN {
            assert_eq!(row, &ColorRow { camera: UNSEEN, ..ColorRow::default() });
            continue;
        }
        let index = usize::from(row.camera);
        n_seen[index] += 1;
        let pixel = visible[index].expect("the camera has the point in view");
        n_off += usize::from(difference(&scene.cameras[index].picture, pixel, *row) > 3.0);
    }
    let n_colored: usize = n_seen.iter().sum();
    println!("{n_colored} of {} points colored, by camera {n_seen:?}, {n_off} off", scene.points.len());
    // The cameras stand up to a metre and a half from the lidar, so they see nearly what it sees, but not all of it.
    let n_hidden = n_visible - n_colored;
    println!("{n_hidden} hidden");
    assert!(n_hidden > 0 && n_hidden * 25 < n_visible, "{n_colored} colored, {n_visible} in view");
    // The lidar looks down to -30 degrees, the cameras to about -18: near points are in nobody's view. The rest is.
    let is_far = |point: &SubmapPoint| point.x.hypot(point.y) > 8.0;
    let far: Vec<u8> = scene.points.iter().zip(&colors).filter(|(p, _)| is_far(p)).map(|(_, row)| row.camera).collect();
    let n_far_seen = far.iter().filter(|camera| **camera != UNSEEN).count();
    println!("{n_far_seen} of {} points beyond 8 m colored", far.len());
    assert!(n_far_seen * 100 > far.len() * 95);
    assert!(n_colored * 100 > scene.points.len() * 55);
    assert!(n_seen.iter().all(|n| *n > 500));
    assert!(n_off * 1000 < n_colored, "{n_off} of {n_colored} colors differ from the image");
}

#[test]
fn a_wrong_exposure_time_is_seen_in_the_colors() {
    let Some(folder) = real_data::real_data("nuscenes") else { return };
    let scene = read_scene(&folder);
    let (right, late) = (colors(&scene, 0), colors(&scene, 40_000_000));
    let changed = |(a, b): &(&ColorRow, &ColorRow)| a.r.abs_diff(b.r) > 3 || a.g.abs_diff(b.g) > 3;
    let n_changed = right.iter().zip(&late).filter(changed).count();
    println!("{n_changed} colors change by 40 ms");
    assert!(n_changed > right.len() / 20, "only {n_changed}");
}

/// For the eye: the points on the front camera's image, colored by depth, and the colored sweep unrolled around the
/// vehicle (3600 columns of 0.1 degrees, 5 pixels per ring).
fn write_pictures(scene: &Scene, colors: &[ColorRow]) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let front = scene.cameras.iter().find(|camera| camera.name == "CAM_FRONT").expect("a front camera");
    let mut overlay = front.picture.clone();
    let mut unrolled = RgbImage::new(3600, 160);
    for (point, row) in scene.points.iter().zip(colors) {
        let azimuth_deg = point.y.atan2(point.x).to_degrees().rem_euclid(360.0);
        let column = (azimuth_deg * 10.0) as u32 % 3600;
        for dy in 0..5 {
            unrolled.put_pixel(column, (31 - u32::from(point.ring)) * 5 + dy, image::Rgb([row.r, row.g, row.b]));
        }
        let Some((u, v)) = pixel(front, point) else { continue };
        let near = (255.0 * (1.0 - point.x.hypot(point.y) / 40.0)).clamp(0.0, 255.0) as u8;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (x, y) = ((u.max(0.0) as u32 + dx).min(1599), (v.max(0.0) as u32 + dy).min(899));
            overlay.put_pixel(x, y, image::Rgb([near, 255 - near, 80]));
        }
    }
    overlay.save(folder.join("nuscenes_overlay.png")).expect("written");
    unrolled.save(folder.join("nuscenes_unrolled.png")).expect("written");
}
