//! A street between two walls at 8 m, painted with squares of half a metre, a vehicle that drives a bend along it, and the
//! images and cubes of its cameras: exact, in f64, by ray casting.

use super::{bare_manifest, camera, mosaic};
use drive::manifest::Manifest;
use geometry::{CameraModel, Isometry3, KannalaBrandt, Pinhole, Point3, Pose, UnitQuaternion, Vector2, Vector3};
use messages::{CubeHeader, ImageHeader, StampedPose, SubmapPoint};
use rayon::prelude::*;
use std::sync::LazyLock;

/// First stamp of the drive.
pub const START: i64 = 1_700_000_000_000_000_000;
pub const SECOND: i64 = 1_000_000_000;
const WALL_M: f64 = 8.0;
const SQUARE_M: f64 = 0.5;

/// Pose at 10 m/s, turning by 0.2 rad/s, far from the origin of odom.
pub fn odom_from_body(stamp: i64) -> Pose {
    let t = (stamp - START) as f64 * 1e-9;
    let speed = 10.0;
    let turn = 0.2;
    let position = Vector3::new((turn * t).sin() * speed / turn, (1.0 - (turn * t).cos()) * speed / turn, 1.8);
    Isometry3::from_parts(
        (position + Vector3::new(400.0, -300.0, 20.0)).into(),
        UnitQuaternion::from_euler_angles(0.0, 0.0, turn * t),
    )
}

/// The frame in which the vehicle starts; the walls are parallel to its x axis.
fn street_from_odom() -> Pose {
    odom_from_body(START).inverse()
}

/// Pose rotated and shifted relative to both odom and street.
pub fn odom_from_submap() -> Pose {
    odom_from_body(START) * Isometry3::new(Vector3::new(3.0, -2.0, 0.5), Vector3::new(0.1, -0.2, 0.7))
}

pub fn trajectory(from: i64, until: i64) -> Vec<StampedPose> {
    // 50 ms apart: the chord deviates less than a millimetre from the arc.
    (0..=(until - from) * 20 / SECOND)
        .map(|i| from + i * SECOND / 20)
        .map(|s| super::stamped(s, odom_from_body(s)))
        .collect()
}

/// Pose of a camera that faces left (+y of the body), rotated by `yaw` to the front.
fn looking_left(yaw: f64) -> Pose {
    let body_from_camera = UnitQuaternion::from_euler_angles(-std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, -yaw);
    Isometry3::from_parts(Vector3::new(0.3, 0.2, 0.4).into(), turn * body_from_camera)
}

fn pinhole() -> CameraModel {
    let width = 400;
    let height = 300;
    let fx = 240.0;
    let fy = 242.0;
    let cx = 203.0;
    let cy = 148.0;
    CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [-0.08, 0.01, 0.001, -0.002, 0.0] })
}

fn fisheye() -> CameraModel {
    let width = 500;
    let height = 360;
    let fx = 230.0;
    let fy = 231.0;
    let cx = 247.0;
    let cy = 182.0;
    let distortion = [-0.02, 0.003, 0.0, 0.0];
    CameraModel::KannalaBrandt(KannalaBrandt { width, height, fx, fy, cx, cy, distortion, max_angle: 1.3 })
}

/// Two color cameras, pinhole to the left and fisheye to the right, and two mosaic cameras to the left.
pub fn manifest() -> Manifest {
    let right = looking_left(std::f64::consts::PI);
    Manifest {
        cameras: vec![camera("left", looking_left(0.3), pinhole()), camera("right", right, fisheye())],
        mosaics: vec![
            mosaic("hs02", looking_left(0.1), fisheye(), 5, [3, 2, 495, 355]),
            mosaic("hs03", looking_left(-0.1), pinhole(), 4, [0, 4, 400, 292]),
        ],
        ..bare_manifest()
    }
}

/// The square (side, along, up) that a ray hits; `None` if it runs along the street or too far.
fn square_of_ray(odom_from_camera: &Pose, ray: &Vector3<f64>) -> Option<[i64; 3]> {
    let street_from_camera = street_from_odom() * odom_from_camera;
    let origin = street_from_camera.translation.vector;
    let direction = street_from_camera.rotation * ray;
    let wall = WALL_M.copysign(direction.y);
    let range_m = (wall - origin.y) / direction.y;
    (range_m > 0.0 && range_m < 100.0).then(|| square(&(origin + direction * range_m)))
}

fn square(p_in_street: &Vector3<f64>) -> [i64; 3] {
    let index = |v: f64| (v / SQUARE_M).floor() as i64;
    [i64::from(p_in_street.y > 0.0), index(p_in_street.x), index(p_in_street.z)]
}

fn paint([side, along, up]: [i64; 3]) -> [u8; 3] {
    let bits = random::mix((side * 7919 + along * 104_729 + up * 1_299_709) as u64);
    [bits >> 16, bits >> 32, bits >> 48].map(|v| v as u8)
}

/// A point in the middle of a square, and the color of the square.
#[derive(Clone, Copy)]
pub struct Painted {
    pub point: SubmapPoint,
    pub color: [u8; 3],
    /// Along the street, m.
    pub along_m: f64,
    pub is_left: bool,
}

/// The squares of both walls, some of them outside of every image, with shots spread over `duration_nanos`.
pub fn points(duration_nanos: u32) -> Vec<Painted> {
    let submap_from_street = (street_from_odom() * odom_from_submap()).inverse();
    let squares = (0..2).flat_map(|side| (-8..50).flat_map(move |along| (-4..7).map(move |up| [side, along, up])));
    let mut points: Vec<Painted> = squares
        .enumerate()
        .map(|(i, square)| {
            let middle = |v: i64| (v as f64 + 0.5) * SQUARE_M;
            let y = if square[0] == 1 { WALL_M } else { -WALL_M };
            let p = submap_from_street * Point3::new(middle(square[1]), y, middle(square[2]));
            // The step is coprime to the other numbers, so that times do not follow positions.
            let offset_nanos = ((i as u64 * 7_368_787) % u64::from(duration_nanos)) as u32;
            let point =
                SubmapPoint { x: p.x as f32, y: p.y as f32, z: p.z as f32, offset_nanos, ..SubmapPoint::default() };
            Painted { point, color: paint(square), along_m: middle(square[1]), is_left: square[0] == 1 }
        })
        .collect();
    let last = points.len() - 1;
    points[last].point.offset_nanos = duration_nanos;
    points
}

/// Offsets of the exposures from the start, ns: two before the submap, three in it, two after it.
pub const EXPOSURES: [i64; 7] =
    [-1_300_000_000, -700_000_000, 50_000_000, 400_000_000, 910_000_000, 1_400_000_000, 1_900_000_000];

/// Exposures of all cameras at one time.
pub struct Burst {
    pub stamp: i64,
    pub images: Vec<(ImageHeader, Vec<u8>)>,
    pub cubes: Vec<(CubeHeader, Vec<u32>)>,
}

/// The bursts at [`EXPOSURES`], rendered once for all tests.
pub fn bursts() -> &'static [Burst] {
    static BURSTS: LazyLock<Vec<Burst>> = LazyLock::new(|| {
        let burst = |stamp| Burst {
            stamp,
            images: (0..2).map(|index| expose(index, stamp)).collect(),
            cubes: (0..2).map(|index| expose_cube(index, stamp)).collect(),
        };
        EXPOSURES.into_par_iter().map(|offset| burst(START + offset)).collect()
    });
    &BURSTS
}

/// The image of color camera `index` at `stamp`.
pub fn expose(index: usize, stamp: i64) -> (ImageHeader, Vec<u8>) {
    let entry = &manifest().cameras[index];
    let odom_from_camera = odom_from_body(stamp) * entry.body_from_camera.to_pose().expect("a pose");
    let (width, height) = entry.model.size();
    let pixels = (0..height).flat_map(|v| (0..width).map(move |u| Vector2::new(f64::from(u), f64::from(v))));
    let color = |pixel: Vector2<f64>| {
        let ray = entry.model.ray_from_pixel(&pixel)?;
        square_of_ray(&odom_from_camera, &ray).map(paint)
    };
    let rows = pixels.flat_map(|pixel| color(pixel).unwrap_or([1, 2, 3])).collect();
    (ImageHeader { camera: index as u32, width, height, channels: 3, exposure_nanos: 1_000_000 }, rows)
}

/// Reflectance of band `k` of mosaic camera `index` on the left wall: brick up to `BORDER_M`, then ivy.
pub const BORDER_M: f64 = 7.0;
pub fn reflectance(index: usize, band: usize, along_m: f64) -> f32 {
    let k = band as f32 * 0.01 + index as f32 * 0.3;
    if along_m < BORDER_M { 0.1 + k } else { 0.6 - k }
}

/// The cube of mosaic camera `index` at `stamp`. Band 3 of camera 1 is dead; camera 0 saturates in its upper half.
pub fn expose_cube(index: usize, stamp: i64) -> (CubeHeader, Vec<u32>) {
    let entry = &manifest().mosaics[index];
    let odom_from_camera = odom_from_body(stamp) * entry.body_from_camera.to_pose().expect("a pose");
    let [x0, y0, width, height] = entry.active_area;
    let pattern = entry.pattern;
    let columns = width / pattern;
    let rows = height / pattern;
    let n_bands = (pattern * pattern) as usize;
    let valid_bands = if index == 1 { 0xffff & !(1 << 3) } else { (1 << 25) - 1 };
    let mut header = CubeHeader {
        camera: index as u32,
        width: columns,
        height: rows,
        n_bands: n_bands as u32,
        pattern,
        valid_bands,
        x0,
        y0,
        exposure_nanos: 5_000_000,
        ..CubeHeader::default()
    };
    for (k, out) in header.wavelengths_nm.iter_mut().take(n_bands).enumerate() {
        *out = 500.0 + 10.0 * k as f32;
    }
    let n_cells = (columns * rows) as usize;
    let mut words = vec![0; (n_bands + 1) * n_cells];
    for cell in 0..n_cells {
        let column = cell as u32 % columns;
        let row = cell as u32 / columns;
        let middle = |first: u32, i: u32| f64::from(first + i * pattern) + 0.5 * f64::from(pattern - 1);
        let ray = entry.model.ray_from_pixel(&Vector2::new(middle(x0, column), middle(y0, row)));
        let along_m = ray
            .and_then(|ray| square_of_ray(&odom_from_camera, &ray))
            .map(|[_, along, _]| (along as f64 + 0.5) * SQUARE_M);
        for band in 0..n_bands {
            words[band * n_cells + cell] = along_m.map_or(0.0, |x| reflectance(index, band, x)).to_bits();
        }
        let is_saturated = index == 0 && row < rows / 2;
        words[n_bands * n_cells + cell] = if is_saturated { 0 } else { u32::MAX };
    }
    (header, words)
}
