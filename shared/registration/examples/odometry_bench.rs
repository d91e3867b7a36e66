//! Time and error of the odometry: `odometry_bench <folder of .pcd>` or, without a folder, a synthetic street with
//! truth; there `SPEED` (m/s), `NOISE` (m) and `SWEEPS` of the environment say which. `VERBOSE` prints the error of
//! each sweep. Prints the median and the 95th percentile of ms per sweep, for features and registration alike, and
//! where it arrived.
#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/support/mod.rs"]
mod support;

use geometry::Isometry3;
use registration::{Odometry, OdometrySettings, Registered, Sweep, TimedPoint};
use std::path::Path;
use std::time::Instant;
use support::world::{Drive, body_from_lidar};

fn main() {
    let number = |name: &str, default: f64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let drive = Drive { speed: number("SPEED", 10.0), noise_m: number("NOISE", 0.02) as f32, ground_only: false };
    let n_sweeps = number("SWEEPS", 40.0) as u32;
    let (sweeps, begin) = match std::env::args().nth(1) {
        Some(folder) => (read_folder(Path::new(&folder)), Isometry3::identity()),
        None => {
            ((0..n_sweeps).map(|number| drive.sweep(number)).collect(), drive.world_from_body(0.0) * body_from_lidar())
        }
    };
    let mut odometry = Odometry::new(OdometrySettings::default(), begin);
    let mut ms = Vec::new();
    let mut registered: Vec<Registered> = Vec::new();
    for sweep in &sweeps {
        let points: Vec<TimedPoint> = sweep.points().to_vec();
        let start = Instant::now();
        let sweep = Sweep::new(sweep.stamp(), points, if sweep.duration_nanos() > 0 { 32 } else { 0 });
        registered.extend(odometry.register(&sweep).unwrap());
        ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    for (number, sweep) in registered.iter().enumerate() {
        let matched = sweep.matched.as_ref().map(|m| {
            format!(
                "{}/{} matches, rms {:.4} m, cost {:.3}, weakest {:.4} ({}), converged {}",
                m.n_matches, m.n_features, m.rms_m, m.cost, m.weakest_influence, m.n_weak_directions, m.converged
            )
        });
        let end = sweep.end().translation.vector;
        println!("{number:3} end {:.3} {:.3} {:.3} {}", end.x, end.y, end.z, matched.unwrap_or("bridged".to_owned()));
    }
    if std::env::args().nth(1).is_none() {
        report_error(&drive, &registered);
    }
    let mut sorted = ms.clone();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    println!(
        "{n} sweeps of {} points: median {:.1} ms, p95 {:.1} ms, max {:.1} ms; map {} points",
        sweeps[0].points().len(),
        sorted[n / 2],
        sorted[n * 95 / 100],
        sorted[n - 1],
        odometry.map().points().len()
    );
}

fn report_error(drive: &Drive, registered: &[Registered]) {
    let mut way = 0.0;
    let mut worst: f64 = 0.0;
    let mut squares = 0.0;
    let mut last = drive.world_from_lidar(0.0);
    for sweep in registered {
        let seconds = |nanos: u32| (sweep.stamp.0 + i64::from(nanos)) as f64 * 1e-9;
        let truth = drive.world_from_lidar(seconds(sweep.duration_nanos));
        way += (truth.translation.vector - last.translation.vector).norm();
        let off = (truth.translation.vector - sweep.end().translation.vector).norm();
        worst = worst.max(off);
        squares += off * off;
        last = truth;
        let mid = drive.world_from_lidar(seconds(sweep.duration_nanos / 2));
        if std::env::var_os("VERBOSE").is_some() {
            let relative = |a: &geometry::Pose, b: &geometry::Pose| (a.inverse() * b).translation.vector;
            let (moved, true_moved) =
                (relative(&sweep.begin(), &sweep.end()), relative(&drive.world_from_lidar(seconds(0)), &truth));
            println!(
                "off {off:.4} m, mid {:.4}, {:.5} rad, skew {:.4} m",
                (mid.translation.vector - sweep.motion.mid.translation.vector).norm(),
                mid.rotation.angle_to(&sweep.motion.mid.rotation),
                (moved - true_moved).norm()
            );
        }
    }
    let rms = (squares / registered.len() as f64).sqrt();
    println!("way {way:.2} m, error rms {rms:.4} m, worst {worst:.4} m, {:.3} % of the way", 100.0 * worst / way);
}

fn read_folder(folder: &Path) -> Vec<Sweep> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "pcd"));
    files.sort();
    files.iter().enumerate().map(|(number, file)| support::untimed(&support::read_pcd(file), number)).collect()
}
