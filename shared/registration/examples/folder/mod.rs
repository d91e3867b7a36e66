//! Sweeps as a folder that other people's odometries read, too:
//!
//! ```text
//! velodyne/000000.bin   float32 x y z intensity, lidar frame at the time of the shot (or *.pcd in the folder itself)
//! times/000000.npy      float64, s after the first shot; without it the sweeps have no point times
//! rings/000000.npy      uint8, 0 = lowest
//! moving/000000.npy     uint8, truth: 1 on a thing that moves during the drive
//! stamps.txt            ns of the first shots, one a line; without it sweeps follow at 10 Hz
//! mounting.txt          body_from_lidar, 12 numbers
//! poses.txt             truth: world_from_lidar at the last shot, 12 numbers a line
//! motion.txt            truth: velocity since the middle of the sweep before, m/s and rad/s in the lidar's axes
//! ```

#![allow(dead_code, reason = "each program uses its own part")]

pub mod npy;

use anyhow::Context;
use geometry::{Pose, Stamp, Vector3};
use registration::{MeasuredMotion, Sweep, TimedPoint, Velocity};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder of sweeps.
pub struct SweepFolder {
    folder: PathBuf,
    clouds: Vec<PathBuf>,
    stamps: Vec<Stamp>,
    /// `body_from_lidar`; the identity where the folder does not say.
    pub mounting: Pose,
}

impl SweepFolder {
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let mut clouds = listing(&folder.join("velodyne"), "bin")?;
        if clouds.is_empty() {
            clouds = listing(folder, "pcd")?;
        }
        anyhow::ensure!(!clouds.is_empty(), "{}: neither velodyne/*.bin nor *.pcd", folder.display());
        let stamps: Vec<Stamp> = match fs::read_to_string(folder.join("stamps.txt")) {
            Ok(text) => text.lines().map(|line| Ok(Stamp(line.trim().parse()?))).collect::<anyhow::Result<_>>()?,
            Err(_) => (0..clouds.len()).map(|number| Stamp(number as i64 * 100_000_000)).collect(),
        };
        anyhow::ensure!(stamps.len() >= clouds.len(), "stamps.txt has {} lines for {}", stamps.len(), clouds.len());
        let mounting = poses(&folder.join("mounting.txt")).ok().and_then(|poses| poses.first().copied());
        Ok(Self { folder: folder.to_owned(), clouds, stamps, mounting: mounting.unwrap_or_else(Pose::identity) })
    }
    pub fn len(&self) -> usize {
        self.clouds.len()
    }
    pub fn stamp(&self, number: usize) -> Stamp {
        self.stamps[number]
    }
    /// The points of a sweep, and how many rings the sensor has (0: not known).
    pub fn points(&self, number: usize) -> anyhow::Result<(Vec<TimedPoint>, u32)> {
        let path = &self.clouds[number];
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        let cloud = if path.extension().is_some_and(|extension| extension == "pcd") {
            formats::pcd::points_from_pcd(&bytes)?
        } else {
            formats::kitti::points_from_bin(&bytes)?
        };
        let beside = |kind: &str| {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            fs::read(self.folder.join(kind).join(format!("{name}.npy"))).ok()
        };
        let times = beside("times").map(|bytes| npy::f64s(&bytes)).transpose()?;
        let rings = beside("rings").map(|bytes| npy::bytes(&bytes)).transpose()?;
        let point = |(idx, p): (usize, &formats::cloud::CloudPoint)| TimedPoint {
            position: [p.x, p.y, p.z],
            offset_nanos: times.as_ref().map_or(0, |times| (times[idx] * 1e9).round() as u32),
            ring: rings.as_ref().map_or(0, |rings| rings[idx]),
        };
        let n_rings = rings.as_ref().map_or(0, |rings| rings.iter().max().map_or(0, |&ring| u32::from(ring) + 1));
        Ok((cloud.iter().enumerate().map(point).collect(), n_rings))
    }
    /// Truth: which points of a sweep are on moving things.
    pub fn moving(&self, number: usize) -> anyhow::Result<Option<Vec<u8>>> {
        let path = self.folder.join("moving").join(format!("{number:06}.npy"));
        fs::read(path).ok().map(|bytes| npy::bytes(&bytes)).transpose()
    }
    /// Truth: `world_from_lidar` at the last shots; empty where the folder has none.
    pub fn truth(&self) -> Vec<Pose> {
        poses(&self.folder.join("poses.txt")).unwrap_or_default()
    }
    /// The true motions with normal noise of so many m/s and rad/s on each axis: the same in each run.
    pub fn measured_motions(&self, (mps, radps): (f64, f64)) -> anyhow::Result<Vec<MeasuredMotion>> {
        let path = self.folder.join("motion.txt");
        let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let variances = [mps, radps].map(|deviation| deviation * deviation);
        let [linear, angular] = variances;
        let diagonal = nalgebra::Vector6::new(linear, linear, linear, angular, angular, angular);
        let covariance = nalgebra::Matrix6::from_diagonal(&diagonal);
        let motion = |(number, line): (usize, &str)| {
            let values = line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
            anyhow::ensure!(values.len() == 6, "motion.txt, line {}: {} numbers, expected 6", number + 1, values.len());
            let noisy = |axis: usize| {
                let deviation = if axis < 3 { mps } else { radps };
                values[axis] + deviation * normal((number * 6 + axis) as u64)
            };
            let velocity = Velocity {
                linear: Vector3::new(noisy(0), noisy(1), noisy(2)),
                angular: Vector3::new(noisy(3), noisy(4), noisy(5)),
            };
            Ok(MeasuredMotion { velocity, covariance })
        };
        text.lines().enumerate().map(motion).collect()
    }
    /// The sweep.
    pub fn sweep(&self, number: usize) -> anyhow::Result<Sweep> {
        let (points, n_rings) = self.points(number)?;
        Ok(Sweep::new(self.stamp(number), points, n_rings))
    }
}

/// A normal number by its seed: the sum of twelve uniform ones (splitmix64), less 6.
fn normal(seed: u64) -> f64 {
    let uniform = |part: u64| {
        let mut z = (seed * 12 + part).wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678_9abc_def1);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(uniform).sum::<f64>() - 6.0
}

/// KITTI poses of a file.
pub fn poses(path: &Path) -> anyhow::Result<Vec<Pose>> {
    let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    Ok(formats::trajectory::poses_from_kitti(&text)?)
}

/// One line of a KITTI file.
pub fn kitti_line(pose: &Pose) -> String {
    let m = pose.to_homogeneous();
    (0..12).map(|i| m[(i / 4, i % 4)].to_string()).collect::<Vec<_>>().join(" ") + "\n"
}

fn listing(folder: &Path, extension: &str) -> anyhow::Result<Vec<PathBuf>> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(Vec::new()) };
    let mut files = entries.map(|entry| Ok(entry?.path())).collect::<anyhow::Result<Vec<_>>>()?;
    files.retain(|file| file.extension().is_some_and(|e| e == extension));
    files.sort();
    Ok(files)
}
