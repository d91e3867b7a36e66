//! Time, memory and drift of the odometry over a long drive: `cargo bench -p registration --bench odometry [-- SWEEPS [MPS]]`.
//!
//! An endless synthetic street, an HDL-32E at 10 Hz. Prints for each tenth of the drive the median and the 95th percentile of the
//! CPU time of all threads (range image, features, registration, moving objects), the points of the map, the bytes of the state,
//! the memory of the process, the position error as a share of the path, and the heading error. Default: 300 sweeps at
//! 10 m/s; 5000 sweeps at 20 m/s are 10 km.
#![allow(missing_docs, reason = "not part of the library")]
#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/suite/support/world.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod world;

use registration::{Odometry, OdometrySettings, Registered};
use rustix::time::{ClockId, clock_gettime};
use world::Drive;

fn main() {
    // Cargo passes `--bench`.
    let numbers: Vec<f64> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let n_sweeps = numbers.first().map_or(300, |&n| n as u32).max(20);
    let drive = Drive { speed: numbers.get(1).copied().unwrap_or(10.0), noise_m: 0.02, ground_only: false };
    let mut odometry = Odometry::new(OdometrySettings::default(), drive.world_from_lidar(0.0));
    println!(
        "path m   median ms  p95 ms  map points  state bytes  resident MB  error m (% of the path), forward m, rotation deg"
    );
    let mut ms = Vec::new();
    let mut last: Option<Registered> = None;
    for number in 0..n_sweeps {
        let raw = drive.sweep(number);
        let points = raw.points().to_vec();
        let begin = cpu_ms();
        let sweep = registration::Sweep::new(raw.stamp(), points, 32);
        last = odometry.register(&sweep).unwrap().pop().or(last);
        ms.push(cpu_ms() - begin);
        if (number + 1) % (n_sweeps / 10) == 0 {
            report(&drive, last.as_ref().unwrap(), &mut ms, &odometry);
        }
    }
}

fn report(drive: &Drive, last: &Registered, ms: &mut Vec<f64>, odometry: &Odometry) {
    let seconds = (last.stamp.0 + i64::from(last.duration_nanos)) as f64 * 1e-9;
    let true_end = drive.world_from_lidar(seconds);
    let truth = true_end.translation.vector;
    let error = last.end().translation.vector - truth;
    let rotation = (last.end().rotation * true_end.rotation.inverse()).scaled_axis().map(f64::to_degrees);
    let state = postcard::to_stdvec(&odometry.save()).unwrap().len();
    ms.sort_by(f64::total_cmp);
    let median = ms[ms.len() / 2];
    let p95 = ms[ms.len() * 95 / 100];
    let path = truth.x;
    println!(
        "{path:7.0} {median:10.2} {p95:7.2} {:11} {state:12} {:12.1}  {:.3} ({:.3} %), {:.3}, {:.3} {:.3} {:.3}",
        odometry.map().len(),
        resident_mb(),
        error.norm(),
        100.0 * error.norm() / path,
        error.x,
        rotation.x,
        rotation.y,
        rotation.z
    );
    ms.clear();
}

/// Resident memory of this process, with one sweep.
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}

fn cpu_ms() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}
