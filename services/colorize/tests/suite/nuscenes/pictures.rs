//! Pictures for visual inspection: `cargo test -p colorize nuscenes -- --nocapture` prints their paths.

use super::sample::{Camera, NuScenesSample, Vehicle, pixel};
use image::imageops::{FilterType, replace, resize};
use image::{Rgb, RgbImage};
use messages::{ColorRow, SubmapPoint, UNSEEN};
use std::path::Path;

/// Size of one camera image in the overview, px.
const TILE: [u32; 2] = [480, 270];
/// Top view: half extent in m and size in px.
const ABOVE_M: [f32; 2] = [36.0, 15.0];
const ABOVE_PX: [u32; 2] = [1440, 600];
const UNSEEN_COLOR: Rgb<u8> = Rgb([70, 30, 80]);

/// Writes the points on the six images by range, the colored points from above with the boxes of vehicles, and the colored sweep
/// as a panorama.
pub fn write(sample: &NuScenesSample, colors: &[ColorRow]) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let save = |name: &str, picture: &RgbImage| {
        let path = folder.join(name);
        picture.save(&path).expect("written");
        println!("{}", path.display());
    };
    let mut tiles = RgbImage::new(3 * TILE[0], 2 * TILE[1]);
    let order = ["CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT"];
    for (place, name) in (0..).zip(order) {
        let camera = sample.cameras.iter().find(|camera| camera.name == name).expect("one of the six");
        let overlay = overlay(camera, sample, colors);
        save(&format!("nuscenes_{name}.png"), &overlay);
        let tile = resize(&overlay, TILE[0], TILE[1], FilterType::Triangle);
        let [x, y] = [place % 3 * TILE[0], place / 3 * TILE[1]];
        replace(&mut tiles, &tile, i64::from(x), i64::from(y));
    }
    let above = above(sample, colors);
    let mut all = RgbImage::new(ABOVE_PX[0], 2 * TILE[1] + ABOVE_PX[1]);
    replace(&mut all, &tiles, 0, 0);
    replace(&mut all, &above, 0, i64::from(2 * TILE[1]));
    // Small enough for a page of text.
    let page = resize(&all, all.width() * 3 / 4, all.height() * 3 / 4, FilterType::Triangle);
    save("nuscenes.jpg", &page);
    save("nuscenes_unrolled.png", &unrolled(sample, colors));
}

/// Points with the color of this camera: red at 3 m over yellow and green to blue at 60 m, logarithmic. Other points in its view:
/// gray with the color of another camera, violet without color.
fn overlay(camera: &Camera, sample: &NuScenesSample, colors: &[ColorRow]) -> RgbImage {
    let mut picture = camera.picture.clone();
    for (point, row) in sample.points.iter().zip(colors) {
        let Some((u, v)) = pixel(camera, point) else { continue };
        let color = match sample.cameras.get(usize::from(row.camera)) {
            Some(of) if of.name == camera.name => by_range(point.x.hypot(point.y)),
            Some(_) => Rgb([150, 150, 150]),
            None => Rgb([200, 0, 255]),
        };
        dot(&mut picture, [u as f32, v as f32], 7, color);
    }
    picture
}

fn by_range(range_m: f32) -> Rgb<u8> {
    let share = ((range_m / 3.0).ln() / 20.0_f32.ln()).clamp(0.0, 1.0) * 4.0;
    let ramp = |middle: f32| (255.0 * (2.0 - (share - middle).abs()).clamp(0.0, 1.0)) as u8;
    Rgb([ramp(0.0), ramp(2.0), ramp(4.0)])
}

/// Top view with forward to the right; the highest point of a pixel is drawn.
fn above(sample: &NuScenesSample, colors: &[ColorRow]) -> RgbImage {
    let mut picture = RgbImage::from_pixel(ABOVE_PX[0], ABOVE_PX[1], Rgb([20, 20, 20]));
    let place = |x: f64, y: f64| {
        // The y axis of the LiDAR is forward, its x axis to the right.
        let share = [y as f32 / ABOVE_M[0], x as f32 / ABOVE_M[1]];
        [0, 1].map(|axis| 0.5 * (share[axis] + 1.0) * ABOVE_PX[axis] as f32)
    };
    let mut order: Vec<(&SubmapPoint, &ColorRow)> = sample.points.iter().zip(colors).collect();
    order.sort_by(|a, b| a.0.z.total_cmp(&b.0.z));
    for (point, row) in order {
        let color = if row.camera == UNSEEN { UNSEEN_COLOR } else { Rgb([row.r, row.g, row.b]) };
        dot(&mut picture, place(f64::from(point.x), f64::from(point.y)), 4, color);
    }
    for vehicle in &sample.boxes {
        outline(vehicle).for_each(|[x, y]| dot(&mut picture, place(x, y), 2, Rgb([255, 220, 0])));
    }
    picture
}

/// Points along the sides of a box, m, LiDAR frame.
fn outline(vehicle: &Vehicle) -> impl Iterator<Item = [f64; 2]> {
    let (sine, cosine) = vehicle.yaw.sin_cos();
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    (0..400).map(move |i| {
        let a = corners[i / 100];
        let b = corners[(i / 100 + 1) % 4];
        let share = (i % 100) as f64 / 100.0;
        let [along, across] = [0, 1].map(|axis| (a[axis] + share * (b[axis] - a[axis])) * vehicle.size[axis]);
        [vehicle.center[0] + along * cosine - across * sine, vehicle.center[1] + along * sine + across * cosine]
    })
}

/// The sweep unrolled: 3600 columns of 0.1 degrees, 5 pixels per ring.
fn unrolled(sample: &NuScenesSample, colors: &[ColorRow]) -> RgbImage {
    let mut picture = RgbImage::new(3600, 160);
    for (point, row) in sample.points.iter().zip(colors) {
        let azimuth_deg = point.y.atan2(point.x).to_degrees().rem_euclid(360.0);
        let column = (azimuth_deg * 10.0) as u32 % 3600;
        for dy in 0..5 {
            picture.put_pixel(column, (31 - u32::from(point.ring)) * 5 + dy, Rgb([row.r, row.g, row.b]));
        }
    }
    picture
}

/// Draws a square, clipped to the picture.
fn dot(picture: &mut RgbImage, [u, v]: [f32; 2], side: i32, color: Rgb<u8>) {
    for (dx, dy) in (0..side * side).map(|i| (i % side - side / 2, i / side - side / 2)) {
        let x = u as i32 + dx;
        let y = v as i32 + dy;
        if x >= 0 && y >= 0 && (x as u32) < picture.width() && (y as u32) < picture.height() {
            picture.put_pixel(x as u32, y as u32, color);
        }
    }
}
