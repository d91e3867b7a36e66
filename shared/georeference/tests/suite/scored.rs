//! Places a drive whose odometry is made from its true motion, and scores the result. Studies of `lab/studies` include this file.

use crate::matched;
use geometry::{Isometry3, Pose, Vector3};
use georeference::{GeoreferenceSettings, Georeferencer, Placed};
use messages::{GnssRow, ImuRow};
use random::{gauss, hash};
use registration::{Registered, SweepMotion};

pub const SWEEP_NANOS: i64 = 100_000_000;
/// Drift of the odometry with gyroscopes: random walks per square root of the path and a wrong scale, as measured with LiDAR
/// (`lab/notebook/odometry.md`): rad and m over 1 m. Gyroscopes and gravity hold the tilt better than the heading.
const WALK_RAD: [f64; 3] = [3e-5, 3e-5, 8e-5];
const WALK_M: f64 = 1.5e-3;
const SCALE: f64 = 3e-4;
/// A submap is closed after this path, m, or this time, ns.
const SUBMAP_M: f64 = 20.0;
const SUBMAP_NANOS: i64 = 5_000_000_000;

/// A drive with its truth.
pub struct ScoredDrive<'a> {
    /// `world_from_body` after a number of ns.
    pub truth: &'a dyn Fn(i64) -> Pose,
    /// Stamp of the start.
    pub begin: i64,
    pub n_sweeps: i64,
    /// Fixes and inertial samples in time order.
    pub fixes: &'a [GnssRow],
    pub samples: &'a [ImuRow],
    /// Seed of the drift.
    pub seed: u64,
}

/// Errors and stated standard deviations of a placed drive.
#[derive(Clone)]
pub struct Score {
    /// Root mean square errors of the submaps: horizontal and up, m, and heading, degrees.
    pub rms: [f64; 3],
    /// Root mean square standard deviations of the submaps, in the same order.
    pub stated: [f64; 3],
    /// Normalized squared errors per degree of freedom, mean of the submaps: horizontal and up.
    pub normalized: [f64; 2],
    /// Mean error to east, north and up, m.
    pub mean_m: Vector3<f64>,
    pub n_fixes: usize,
    pub n_used: usize,
}

#[allow(dead_code, reason = "for studies")]
impl Score {
    pub const HEADER: &'static str =
        "across m  up m  heading deg   stated: across    up  heading   normalized: across      up   fixes used";
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { rms: [across, up, heading], stated: [a, u, h], normalized: [x, z], mean_m, n_fixes, n_used } = self;
        write!(
            f,
            "{across:8.2}{up:6.2}{heading:13.3}{a:17.2}{u:6.2}{h:9.3}{x:21.2}{z:8.2}{n_used:9}/{n_fixes}  mean error {:.2} {:.2} {:.2}",
            mean_m.x, mean_m.y, mean_m.z
        )
    }
}

impl ScoredDrive<'_> {
    /// Places the drive; `None` if the result is not georeferenced.
    pub fn place(&self, settings: &GeoreferenceSettings) -> Option<Score> {
        let Self { truth, begin, samples, fixes, .. } = self;
        let mut georeferencer = Georeferencer::new(settings);
        let mut odometry = Isometry3::identity();
        let mut submap: Option<(f64, i64)> = None;
        let mut submaps: Vec<Pose> = Vec::new();
        for k in 0..self.n_sweeps {
            let from = k * SWEEP_NANOS;
            let to = from + SWEEP_NANOS;
            let before = |stamp: i64, nanos: i64| stamp - begin < nanos;
            let first = samples.partition_point(|row| before(row.stamp, from));
            let last = samples.partition_point(|row| before(row.stamp, to));
            georeferencer.add_imu(&samples[first..last], settings);
            let first = fixes.partition_point(|row| before(row.stamp, from));
            let last = fixes.partition_point(|row| before(row.stamp, to));
            georeferencer.add_gnss(&fixes[first..last], settings);
            let end = odometry * drifted(&truth(from).inv_mul(&truth(to)), hash(self.seed, 1000 + k as u64));
            let path_m = (end.translation.vector - odometry.translation.vector).norm();
            if submap.is_none_or(|(m, since)| m >= SUBMAP_M || from - since >= SUBMAP_NANOS) {
                let odom_from_submap =
                    Isometry3::from_parts(odometry.translation, geometry::heading(&odometry.rotation));
                georeferencer.begin_submap(odom_from_submap, begin + from);
                submaps.push(truth(from) * odometry.inv_mul(&odom_from_submap));
                submap = Some((0.0, from));
            }
            georeferencer.add_sweep(&registered(begin + from, &odometry, &end), &odometry, &end);
            submap = submap.map(|(m, since)| (m + path_m, since));
            odometry = end;
            georeferencer.update(settings);
        }
        let placed = georeferencer.solve(settings).filter(|placed| placed.header.frame != messages::FRAME_LOCAL)?;
        Some(score(&placed, &submaps))
    }
}

fn drifted(motion: &Pose, seed: u64) -> Pose {
    let root = motion.translation.vector.norm().sqrt();
    let draw = |k: u64, size: f64| f64::from(gauss(hash(seed, k))) * size * root;
    let m = Vector3::new(draw(0, WALK_M), draw(1, WALK_M), draw(2, WALK_M));
    let rad = Vector3::new(draw(3, WALK_RAD[0]), draw(4, WALK_RAD[1]), draw(5, WALK_RAD[2]));
    let scaled = Isometry3::from_parts((motion.translation.vector * (1.0 + SCALE)).into(), motion.rotation);
    scaled * Isometry3::new(m, rad)
}

fn registered(stamp: i64, begin: &Pose, end: &Pose) -> Registered {
    let motion = SweepMotion {
        mid: *begin,
        translation: end.translation.vector - begin.translation.vector,
        rotation: (begin.rotation.inverse() * end.rotation).scaled_axis(),
    };
    matched::registered(stamp, SWEEP_NANOS as u32, motion, 2000, true)
}

fn score(placed: &Placed, truth: &[Pose]) -> Score {
    let n = placed.rows.len() as f64;
    let mut squares = [0.0; 3];
    let mut stated = [0.0; 3];
    let mut normalized = [0.0; 2];
    let mut mean_m = Vector3::zeros();
    for (row, truth) in placed.rows.iter().zip(truth) {
        let pose: Pose = row.world_from_submap.to_pose().unwrap_or_default();
        let off = pose.translation.vector - truth.translation.vector;
        let turned_deg = (truth.rotation.inverse() * pose.rotation).scaled_axis().z.to_degrees();
        mean_m += off / n;
        let deviation = row.deviation();
        let errors = [off.xy().norm(), off.z, turned_deg];
        let deviations = [deviation.position_m, deviation.height_m, deviation.heading_deg];
        for k in 0..3 {
            squares[k] += errors[k].powi(2) / n;
            stated[k] += deviations[k].powi(2) / n;
        }
        let off = pose.rotation.inverse() * off;
        let [x, y, z] = row.sigma_m.map(f64::from);
        normalized[0] += (off.x / x).hypot(off.y / y).powi(2) / 2.0 / n;
        normalized[1] += (off.z / z).powi(2) / n;
    }
    Score {
        rms: squares.map(f64::sqrt),
        stated: stated.map(f64::sqrt),
        normalized,
        mean_m,
        n_fixes: placed.fixes.n,
        n_used: placed.fixes.n_used,
    }
}

/// Prints root mean squares over drives, and the means of the normalized errors.
#[allow(dead_code, reason = "for studies")]
pub fn print_mean(scores: &[Score]) {
    let n = scores.len() as f64;
    let rms = |of: &dyn Fn(&Score) -> f64| (scores.iter().map(|score| of(score).powi(2)).sum::<f64>() / n).sqrt();
    let [across, up, heading] = [0, 1, 2].map(|k| rms(&|score| score.rms[k]));
    let [a, u, h] = [0, 1, 2].map(|k| rms(&|score| score.stated[k]));
    let [x, z] = [0, 1].map(|k| scores.iter().map(|score| score.normalized[k]).sum::<f64>() / n);
    println!(
        "RMS of {n} drives: {across:.2} m across, {up:.2} m up, {heading:.3} degrees; stated {a:.2} {u:.2} {h:.3}; normalized squared error \
         per degree of freedom (1 expected): {x:.2} across, {z:.2} up"
    );
}
