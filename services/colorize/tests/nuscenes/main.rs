//! One real HDL-32E sweep and the six cameras around it (nuScenes), with the data set's own calibration.
//!
//! The truth is computed here along another way: the data set's composed `camera_from_lidar` and intrinsic matrices,
//! which know nothing of stamps, trajectories and rigs.

#[path = "../common/mod.rs"]
mod common;
mod pictures;
mod scene;

use colorize::{Colorize, Settings};
use common::{bare_manifest, camera, drive, stamped, submap};
use formats::manifest::PoseEntry;
use geometry::{CameraModel, Pinhole};
use image::RgbImage;
use messages::{Color, ColorRow, Image, ImageHeader, NoHeader, Submap, SubmapPoint, Trajectory, UNSEEN};
use scene::{Scene, Vehicle, pixel, pose, read_scene};
use stage::testing::{Bench, context};

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
    pictures::write(&scene, &colors);

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

#[test]
fn the_boxes_of_cars_have_the_colors_that_the_cars_have() {
    let Some(folder) = real_data::real_data("nuscenes") else { return };
    let scene = read_scene(&folder);
    let colors = colors(&scene, 0);
    let mean = |name: &str, [right, ahead]: [f64; 2], is_of: &dyn Fn(&SubmapPoint, &Vehicle) -> bool| {
        let is_it = |vehicle: &&Vehicle| (vehicle.center[0] - right).hypot(vehicle.center[1] - ahead) < 1.0;
        let vehicle = scene.boxes.iter().find(is_it).expect("a box there");
        let is_of = |point: &SubmapPoint| vehicle.holds(point) && is_of(point, vehicle);
        let rows = scene.points.iter().zip(&colors).filter(|(point, row)| row.camera != UNSEEN && is_of(point));
        let levels: Vec<f64> =
            rows.map(|(_, row)| [row.r, row.g, row.b].map(f64::from).iter().sum::<f64>() / 3.0).collect();
        println!("{name}: {} points, mean level {:.0}", levels.len(), levels.iter().sum::<f64>() / levels.len() as f64);
        levels.iter().sum::<f64>() / levels.len() as f64
    };
    // What the images show there: silver in the sun, silver in the shade, black in the sun, and a truck with a white tail lift and dark sides.
    let all = |_: &SubmapPoint, _: &Vehicle| true;
    let bright = mean("silver car in the sun", [3.3, 40.3], &all);
    let shaded = mean("silver car in the shade", [-2.1, 38.0], &all);
    let black = mean("black car", [6.0, 35.0], &all);
    let from_back_m =
        |point: &SubmapPoint, truck: &Vehicle| f64::from(point.y) - (truck.center[1] - 0.5 * truck.size[0]);
    // The lift stands between the bumper and the tarpaulin.
    let is_lift = |point: &SubmapPoint| point.z > -0.9 && point.z < 0.9;
    let lift = mean("tail lift", [-4.5, 15.3], &|point, truck| from_back_m(point, truck) < 0.8 && is_lift(point));
    let sides = mean("truck before it", [-4.5, 15.3], &|point, truck| from_back_m(point, truck) > 1.5);
    assert!(bright > 140.0 && black < 90.0 && shaded > black && lift > 1.5 * sides);
}
