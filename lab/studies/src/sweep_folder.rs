//! A folder of sweeps in a layout that other odometry implementations also read:
//!
//! ```text
//! velodyne/000000.bin   float32 x y z intensity, LiDAR frame at the time of the shot (or *.pcd in the folder itself)
//! times/000000.npy      float64, s after the first shot; without it the sweeps have no point times
//! rings/000000.npy      uint8, 0 = lowest
//! moving/000000.npy     uint8, truth: 1 on an object that moves during the drive
//! stamps.txt            ns of the first shots, one a line; without it sweeps follow at 10 Hz
//! mounting.txt          body_from_lidar, 12 numbers
//! poses.txt             truth: world_from_lidar at the last shot, 12 numbers a line
//! imu.csv               inertial samples, see `drive::imu`
//! velocities.csv        of a receiver: stamp, m/s towards east and north, standard deviation
//! places.txt            positions of inertial unit and antenna in the body, m, one a line
//! ```

use anyhow::Context;
use candle_core::{Tensor, WithDType};
use geometry::{Point3, Pose, Stamp};
use registration::{GroundVelocity, InertialSample, SensorMounting, Sweep, TimedPoint};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder of sweeps.
pub struct SweepFolder {
    folder: PathBuf,
    clouds: Vec<PathBuf>,
    stamps: Vec<Stamp>,
    /// `body_from_lidar`; the identity if the folder has no mounting.txt.
    pub mounting: Pose,
}

impl SweepFolder {
    /// Lists the sweeps of a folder. The points are read later.
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
    /// Number of sweeps, at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a folder without sweeps is refused")]
    pub fn len(&self) -> usize {
        self.clouds.len()
    }
    /// First shot of a sweep.
    pub fn stamp(&self, number: usize) -> Stamp {
        self.stamps[number]
    }
    /// The points of a sweep, and the sensor's number of rings (0: not known).
    pub fn points(&self, number: usize) -> anyhow::Result<(Vec<TimedPoint>, u32)> {
        let path = &self.clouds[number];
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        let cloud = if path.extension().is_some_and(|extension| extension == "pcd") {
            formats::pcd::points_from_pcd(&bytes)?
        } else {
            formats::kitti::points_from_bin(&bytes)?
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let times: Option<Vec<f64>> = self.array("times", &name)?;
        let rings: Option<Vec<u8>> = self.array("rings", &name)?;
        let point = |(idx, p): (usize, &formats::cloud::CloudPoint)| TimedPoint {
            position: [p.x, p.y, p.z],
            offset_nanos: times.as_ref().map_or(0, |times| (times[idx] * 1e9).round() as u32),
            ring: rings.as_ref().map_or(0, |rings| rings[idx]),
        };
        let n_rings = rings.as_ref().map_or(0, |rings| rings.iter().max().map_or(0, |&ring| u32::from(ring) + 1));
        Ok((cloud.iter().enumerate().map(point).collect(), n_rings))
    }
    /// Truth: the points of a sweep that are on moving objects.
    pub fn moving(&self, number: usize) -> anyhow::Result<Option<Vec<u8>>> {
        self.array("moving", &format!("{number:06}"))
    }
    /// An array of `NumPy`; `None` if there is no such file.
    fn array<T: WithDType>(&self, kind: &str, name: &str) -> anyhow::Result<Option<Vec<T>>> {
        let path = self.folder.join(kind).join(format!("{name}.npy"));
        if !path.exists() {
            return Ok(None);
        }
        let array = Tensor::read_npy(&path).and_then(|array| array.flatten_all()?.to_vec1());
        array.map(Some).with_context(|| path.display().to_string())
    }
    /// Truth: `world_from_lidar` at the last shots; empty without poses.txt.
    pub fn truth(&self) -> Vec<Pose> {
        poses(&self.folder.join("poses.txt")).unwrap_or_default()
    }
    /// Mounting of the sensors.
    pub fn sensor_mounting(&self) -> anyhow::Result<SensorMounting> {
        let mut mounting = SensorMounting { body_from_lidar: self.mounting, ..SensorMounting::default() };
        if let Ok(text) = fs::read_to_string(self.folder.join("places.txt")) {
            let rows: Vec<Vec<f64>> = rows(&text, ' ')?;
            anyhow::ensure!(rows.len() == 2 && rows.iter().all(|row| row.len() == 3), "places.txt: two lines of three");
            mounting.imu_in_body = Point3::from_slice(&rows[0]);
            mounting.antenna_in_body = Point3::from_slice(&rows[1]);
        }
        Ok(mounting)
    }
    /// All inertial samples.
    pub fn inertial(&self) -> anyhow::Result<Vec<InertialSample>> {
        let file = fs::File::open(self.folder.join("imu.csv")).context("imu.csv")?;
        let samples = drive::imu::ImuReader::new(std::io::BufReader::new(file));
        let sample = |sample: drive::imu::ImuSample| InertialSample {
            stamp: sample.stamp,
            force: sample.acceleration.into(),
            rate: sample.angular_rate.into(),
        };
        Ok(samples.map(|read| read.map(sample)).collect::<Result<_, _>>()?)
    }
    /// All velocities of the receiver.
    pub fn velocities(&self) -> anyhow::Result<Vec<GroundVelocity>> {
        let text = fs::read_to_string(self.folder.join("velocities.csv")).context("velocities.csv")?;
        let velocity = |line: &str| {
            let (stamp, numbers) = line.split_once(',').context("velocities.csv: stamp,east,north,sigma")?;
            let numbers: Vec<f64> = rows(numbers, ',')?.concat();
            let [east, north, sigma] = numbers[..] else { anyhow::bail!("velocities.csv: {line:?}") };
            Ok(GroundVelocity { stamp: Stamp(stamp.parse()?), east_north: [east, north], sigma, late_sigma_s: 0.0 })
        };
        text.lines().map(velocity).collect()
    }
    /// Reads a sweep.
    pub fn sweep(&self, number: usize) -> anyhow::Result<Sweep> {
        let (points, n_rings) = self.points(number)?;
        Ok(Sweep::new(self.stamp(number), points, n_rings))
    }
}

fn rows(text: &str, separator: char) -> anyhow::Result<Vec<Vec<f64>>> {
    let row = |line: &str| line.trim().split(separator).map(|field| Ok(field.trim().parse()?)).collect();
    text.lines().map(row).collect()
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
