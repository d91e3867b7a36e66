//! One real HDL-32E sweep and its six camera images (nuScenes), with the calibration of the data set.
//!
//! The expected values are computed independently: from the composed `camera_from_lidar` and intrinsic matrices of the data
//! set, without stamps, trajectory and rig.

mod pictures;
mod sample;

use crate::support::{bare_manifest, camera, drive, stamped, submap};
use colorize::{Colorize, Settings};
use drive::manifest::PoseEntry;
use geometry::{CameraModel, Pinhole};
use image::RgbImage;
use messages::{
    ColorRow, ColorTopic, ImageHeader, ImageTopic, NoHeader, SubmapPoint, SubmapTopic, TrajectoryTopic, UNSEEN,
};
use sample::{NuScenesSample, Vehicle, pixel, pose, read_sample};
use stage::testing::{Bench, context};

/// Runs the stage with `delay_nanos` added to the stamps of all images.
fn colors(sample: &NuScenesSample, delay_nanos: i64) -> Vec<ColorRow> {
    let mut manifest = bare_manifest();
    manifest.lidar.body_from_lidar = PoseEntry::from(sample.body_from_lidar);
    for entry in &sample.cameras {
        let k = entry.image_from_camera;
        let fx = k[(0, 0)];
        let fy = k[(1, 1)];
        let cx = k[(0, 2)];
        let cy = k[(1, 2)];
        let (width, height) = entry.picture.dimensions();
        let model = CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] });
        manifest.cameras.push(camera(&entry.name, entry.body_from_camera, model));
    }
    let folder = drive(&manifest);
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");

    // The composed matrices contain the pose of the vehicle at each exposure.
    let mut poses = vec![(sample.stamp, sample.world_from_lidar * sample.body_from_lidar.inverse())];
    for entry in &sample.cameras {
        let world_from_camera = sample.world_from_lidar * pose(&entry.camera_from_lidar).inverse();
        poses.push((entry.stamp, world_from_camera * entry.body_from_camera.inverse()));
    }
    poses.sort_by_key(|(stamp, _)| *stamp);
    // The trajectory is extrapolated for exposures with later stamps.
    let a = poses[0];
    let b = poses[poses.len() - 1];
    poses.push((2 * b.0 - a.0, b.1 * a.1.inverse() * b.1));
    let rows = poses.iter().map(|(stamp, pose)| stamped(*stamp, *pose)).collect();
    bench.send::<TrajectoryTopic>(sample.stamp, NoHeader::default(), rows);
    for (index, entry) in sample.cameras.iter().enumerate() {
        let (width, height) = entry.picture.dimensions();
        let header = ImageHeader { camera: index as u32, width, height, channels: 3, exposure_nanos: 5_000_000 };
        bench.send::<ImageTopic>(entry.stamp + delay_nanos, header, entry.picture.as_raw().clone());
    }
    let header = submap(sample.world_from_lidar, sample.stamp, &sample.points);
    bench.send::<SubmapTopic>(sample.stamp, header, sample.points.clone());
    bench.tick().expect("a tick");
    bench.finish().expect("an end");
    bench.take::<ColorTopic>()[0].rows().to_vec()
}

/// Largest difference of a channel between the point's color and the picture at the pixel, between pixel centers.
fn difference(picture: &RgbImage, (u, v): (f64, f64), row: ColorRow) -> f64 {
    let clamp = |at: f64, len: u32| at.clamp(0.0, f64::from(len - 1));
    let u = clamp(u, picture.width());
    let v = clamp(v, picture.height());
    let colors = [row.r, row.g, row.b];
    let at = |x: f64, y: f64, i: usize| {
        let x = (x as u32).min(picture.width() - 1);
        let y = (y as u32).min(picture.height() - 1);
        f64::from(picture.get_pixel(x, y)[i])
    };
    let mixed = |i: usize| {
        let a = u.fract();
        let b = v.fract();
        let top = (1.0 - a) * at(u, v, i) + a * at(u + 1.0, v, i);
        (1.0 - b) * top + b * ((1.0 - a) * at(u, v + 1.0, i) + a * at(u + 1.0, v + 1.0, i))
    };
    (0..3).map(|i| (mixed(i) - f64::from(colors[i])).abs()).fold(0.0, f64::max)
}

#[real_data::test("nuscenes")]
fn real_sweep_gets_colors_of_six_real_images() {
    let sample = read_sample(&real_data::path("nuscenes"));
    assert_eq!((sample.points.len(), sample.cameras.len()), (34_688, 6));
    let colors = colors(&sample, 0);
    pictures::write(&sample, &colors);

    let mut n_seen = [0; 6];
    let mut n_off = 0;
    let mut n_visible = 0;
    for (point, row) in sample.points.iter().zip(&colors) {
        let visible: Vec<Option<(f64, f64)>> = sample.cameras.iter().map(|camera| pixel(camera, point)).collect();
        n_visible += usize::from(visible.iter().any(Option::is_some));
        if row.camera == UNSEEN {
            assert_eq!(row, &ColorRow { camera: UNSEEN, ..ColorRow::default() });
            continue;
        }
        let index = usize::from(row.camera);
        n_seen[index] += 1;
        let pixel = visible[index].expect("the camera has the point in view");
        n_off += usize::from(difference(&sample.cameras[index].picture, pixel, *row) > 3.0);
    }
    let n_colored: usize = n_seen.iter().sum();
    println!("{n_colored} of {} points colored, by camera {n_seen:?}, {n_off} off", sample.points.len());
    // The cameras are up to 1.5 m from the LiDAR, and no color is taken within a cell of a silhouette: 157 of 20 198 points in
    // view (0.8 %) are occluded.
    let n_hidden = n_visible - n_colored;
    println!("{n_hidden} of {n_visible} points in view are occluded");
    assert!(n_hidden > 0 && n_hidden * 100 < n_visible, "{n_colored} colored, {n_visible} in view");
    // The LiDAR sees down to -30 degrees, the cameras to about -18: only near points are in no view.
    let is_far = |point: &SubmapPoint| point.x.hypot(point.y) > 8.0;
    let far: Vec<u8> =
        sample.points.iter().zip(&colors).filter(|(p, _)| is_far(p)).map(|(_, row)| row.camera).collect();
    let n_far_seen = far.iter().filter(|camera| **camera != UNSEEN).count();
    println!("{n_far_seen} of {} points beyond 8 m colored", far.len());
    assert!(n_far_seen * 100 > far.len() * 95);
    assert!(n_colored * 100 > sample.points.len() * 55);
    assert!(n_seen.iter().all(|n| *n > 500));
    assert!(n_off * 1000 < n_colored, "{n_off} of {n_colored} colors differ from the image");
}

#[real_data::test("nuscenes")]
fn delay_of_40_ms_changes_colors() {
    let sample = read_sample(&real_data::path("nuscenes"));
    let right = colors(&sample, 0);
    let late = colors(&sample, 40_000_000);
    let changed = |(a, b): &(&ColorRow, &ColorRow)| a.r.abs_diff(b.r) > 3 || a.g.abs_diff(b.g) > 3;
    let n_changed = right.iter().zip(&late).filter(changed).count();
    println!("{n_changed} colors change with a delay of 40 ms");
    assert!(n_changed > right.len() / 20, "only {n_changed}");
}

#[real_data::test("nuscenes")]
fn points_in_vehicle_boxes_have_vehicle_colors() {
    let sample = read_sample(&real_data::path("nuscenes"));
    let colors = colors(&sample, 0);
    let mean = |name: &str, [right, ahead]: [f64; 2], is_of: &dyn Fn(&SubmapPoint, &Vehicle) -> bool| {
        let is_it = |vehicle: &&Vehicle| (vehicle.center[0] - right).hypot(vehicle.center[1] - ahead) < 1.0;
        let vehicle = sample.boxes.iter().find(is_it).expect("a box there");
        let is_of = |point: &SubmapPoint| vehicle.holds(point) && is_of(point, vehicle);
        let rows = sample.points.iter().zip(&colors).filter(|(point, row)| row.camera != UNSEEN && is_of(point));
        let levels: Vec<f64> =
            rows.map(|(_, row)| [row.r, row.g, row.b].map(f64::from).iter().sum::<f64>() / 3.0).collect();
        println!("{name}: {} points, mean level {:.0}", levels.len(), levels.iter().sum::<f64>() / levels.len() as f64);
        levels.iter().sum::<f64>() / levels.len() as f64
    };
    // The images show a silver car in the sun, one in the shade, a black car in the sun, and a truck with a white tail lift and dark
    // sides.
    let all = |_: &SubmapPoint, _: &Vehicle| true;
    let bright = mean("silver car in the sun", [3.3, 40.3], &all);
    let shaded = mean("silver car in the shade", [-2.1, 38.0], &all);
    let black = mean("black car", [6.0, 35.0], &all);
    let from_back_m =
        |point: &SubmapPoint, truck: &Vehicle| f64::from(point.y) - (truck.center[1] - 0.5 * truck.size[0]);
    // The lift is between bumper and tarpaulin.
    let is_lift = |point: &SubmapPoint| point.z > -0.9 && point.z < 0.9;
    let lift = mean("tail lift", [-4.5, 15.3], &|point, truck| from_back_m(point, truck) < 0.8 && is_lift(point));
    let sides = mean("truck before it", [-4.5, 15.3], &|point, truck| from_back_m(point, truck) > 1.5);
    assert!(bright > 140.0 && black < 90.0 && shaded > black && lift > 1.5 * sides);
}
