//! Colored points per second on one thread and on all: `cargo run --release -p studies --example color_bench`.
//!
//! A vehicle at 10 m/s with six cameras at 1 Hz and points up to 100 m around it, nearly all of them visible in some exposure:
//! once with pinhole lenses of 70 degrees, once with wide fisheyes.

use coloring::{
    AgeLimits, Candidates, ColorImage, ColorSteps, PointBuffers, PosedExposure, ProjectionCamera, SubmapPoints,
    color_into, visibility_maps,
};
use geometry::{CameraModel, Isometry3, KannalaBrandt, Pinhole, RigCamera, UnitQuaternion, Vector3};
use messages::{ColorRow, SubmapPoint, SubmapSweep, UNSEEN};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};
use std::time::Instant;

const N_POINTS: u32 = 3_000_000;
const WIDTH: u32 = 1600;
const HEIGHT: u32 = 900;

fn main() {
    println!("occlusion and choice included");
    bench(
        "pinhole",
        &CameraModel::Pinhole(Pinhole {
            width: WIDTH,
            height: HEIGHT,
            fx: 1140.0,
            fy: 1140.0,
            cx: 800.0,
            cy: 450.0,
            distortion: [-0.1, 0.01, 0.0, 0.0, 0.0],
        }),
    );
    bench(
        "fisheye",
        &CameraModel::KannalaBrandt(KannalaBrandt {
            width: WIDTH,
            height: HEIGHT,
            fx: 800.0,
            fy: 800.0,
            cx: 800.0,
            cy: 450.0,
            distortion: [-0.02, 0.004, 0.0, 0.0],
            max_angle: 1.2,
        }),
    );
}

fn bench(name: &str, model: &CameraModel) {
    let (sweeps, points) = street();
    let cameras: Vec<ProjectionCamera> = (0..6)
        .map(|i| {
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, f64::from(i) * FRAC_PI_3);
            let forward = UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
            let body_from_camera = Isometry3::from_parts(Vector3::new(0.0, 0.0, 0.3).into(), turn * forward);
            ProjectionCamera::from(&RigCamera { body_from_camera, model: model.clone() })
        })
        .collect();
    let bytes: Vec<u8> = (0..WIDTH * HEIGHT * 3).map(|i| (i % 251) as u8).collect();
    let mut exposures: Vec<PosedExposure<'_>> = Vec::new();
    let mut images: Vec<ColorImage<'_>> = Vec::new();
    for second in -1..=6 {
        for (index, camera) in (0..).zip(&cameras) {
            let stamp = second * 1_000_000_000 + 300_000_000;
            let odom_from_body = Isometry3::translation(stamp as f64 * 1e-8, 0.0, 0.0);
            exposures.push(camera.exposure(stamp, &odom_from_body, &Isometry3::identity()));
            images.extend(ColorImage::new(index, WIDTH, HEIGHT, &bytes));
        }
    }
    for (exposures, images) in [(&exposures[6..7], &images[6..7]), (&exposures[..], &images[..])] {
        measure(name, &points, &sweeps, exposures, images);
    }
}

fn measure(
    name: &str,
    points: &[SubmapPoint],
    sweeps: &[SubmapSweep],
    exposures: &[PosedExposure<'_>],
    images: &[ColorImage<'_>],
) {
    let mut rows = vec![ColorRow::default(); points.len()];
    let mut buffers = PointBuffers::default();
    for threads in [1, rayon::current_num_threads()] {
        let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else { return };
        let best = (0..5)
            .map(|_| {
                let start = Instant::now();
                pool.install(|| color(points, sweeps, exposures, images, &mut buffers, &mut rows));
                start.elapsed().as_secs_f64()
            })
            .fold(f64::INFINITY, f64::min);
        let n_seen = rows.iter().filter(|row| row.camera != UNSEEN).count();
        let million_per_s = f64::from(N_POINTS) / best * 1e-6;
        println!(
            "{name}, {threads} threads: {million_per_s:.1} million points/s ({:.0} % seen, {} exposures)",
            100.0 * n_seen as f64 / points.len() as f64,
            exposures.len()
        );
    }
}

/// Occlusion, choice and sampling.
fn color(
    points: &[SubmapPoint],
    sweeps: &[SubmapSweep],
    exposures: &[PosedExposure<'_>],
    images: &[ColorImage<'_>],
    buffers: &mut PointBuffers,
    rows: &mut [ColorRow],
) {
    let points = SubmapPoints::new(points, sweeps, 0, 32, buffers);
    let limits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };
    let visibility = visibility_maps(&points, exposures);
    let candidates = Candidates { points: &points, exposures, visibility: &visibility, limits };
    color_into(&candidates, images, ColorSteps::default(), rows);
}

/// 50 sweeps of 0.1 s of a LiDAR at 10 m/s, in firing order.
fn street() -> (Vec<SubmapSweep>, Vec<SubmapPoint>) {
    let n_sweeps = 50;
    let per_sweep = N_POINTS / n_sweeps;
    let sweep = |i: u32| SubmapSweep { stamp: i64::from(i) * 100_000_000, ..SubmapSweep::default() };
    let point = |i: u32| {
        let sweep_idx = i / per_sweep;
        let shot = i % per_sweep;
        let offset_nanos = (u64::from(shot) * 100_000_000 / u64::from(per_sweep)) as u32;
        let azimuth = f64::from(shot / 32) * std::f64::consts::TAU / f64::from(per_sweep / 32);
        let elevation = (-30.67 + 1.333 * f64::from(shot % 32)).to_radians();
        // A street with walls at 8 m on both sides, seen from 2 m above the ground.
        let to_wall = 8.0 / azimuth.sin().abs().max(0.08);
        let range_m = if elevation < 0.0 { to_wall.min(2.0 / -elevation.tan()) } else { to_wall };
        let forward = f64::from(sweep_idx) + f64::from(offset_nanos) * 1e-8;
        SubmapPoint {
            x: (forward + range_m * azimuth.cos()) as f32,
            y: (range_m * azimuth.sin()) as f32,
            z: (range_m * elevation.tan()) as f32,
            offset_nanos,
            sweep_idx: sweep_idx as u16,
            ..SubmapPoint::default()
        }
    };
    ((0..n_sweeps).map(sweep).collect(), (0..N_POINTS).map(point).collect())
}
