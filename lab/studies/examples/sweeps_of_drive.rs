//! Writes the sweeps of a drive as a folder that other odometry implementations read (layout: `studies::sweep_folder`):
//! `sweeps_of_drive DRIVE OUT`, or `sweeps_of_drive --simulate TOWN SEED SECONDS OUT [--rig RIG]` for a simulated drive with the
//! LiDAR only (urban, suburban, rural, field, tunnel, motorway; rig l3d2, survey, nuscenes, kitti or a file), with `--traffic dense`
//! for a queue, with `--lidar-errors poor` (or typical) for a unit with errors. The simulated drive itself is deleted.

use anyhow::Context;
use candle_core::{Device, Tensor, WithDType};
use drive::{Drive, SweepInfo};
use geometry::{Pose, Stamp, Trajectory, Vector3, interpolate};
use lidar::SweepPoint;
use raytrace::Ray;
use registration::GroundVelocity;
use simulation::{DriveSettings, DriveSpec, Simulation};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use studies::sweep_folder::kitti_line;

const USAGE: &str = "usage: sweeps_of_drive DRIVE OUT, or sweeps_of_drive --simulate TOWN SEED SECONDS OUT [--rig RIG] \
                     [--traffic TRAFFIC] [--lidar-errors GRADE]";

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--simulate", town, seed, seconds, out, options @ ..] => {
            let town = town.parse()?;
            let seed = seed.parse()?;
            let seconds = seconds.parse()?;
            let mut settings = DriveSettings { town, seed, seconds, ..DriveSettings::default() };
            for option in options.chunks(2) {
                match option {
                    ["--rig", rig] => (*rig).clone_into(&mut settings.rig),
                    ["--traffic", traffic] => settings.traffic = traffic.parse()?,
                    ["--lidar-errors", grade] => settings.lidar_errors = grade.parse()?,
                    _ => anyhow::bail!("{USAGE}"),
                }
            }
            let spec = settings.spec()?;
            let spec = DriveSpec { cameras: false, mosaics: false, ..spec };
            let drive = Path::new(out).join("drive");
            fs::create_dir_all(out)?;
            simulation::write_drive(&spec, &drive, &mut |_| {})?;
            let movers = Movers { simulation: Simulation::new(&spec)?, votes: BTreeMap::new() };
            write(&drive, Path::new(out), Some(movers))?;
            Ok(fs::remove_dir_all(&drive)?)
        }
        [drive, out] => write(Path::new(drive), Path::new(out), None),
        _ => anyhow::bail!("{USAGE}"),
    }
}

fn write(drive: &Path, out: &Path, mut movers: Option<Movers>) -> anyhow::Result<()> {
    let drive = Drive::open(drive)?;
    let truth = drive.true_trajectory().transpose().map_err(|problem| anyhow::anyhow!("{problem}"))?;
    let body_from_lidar = drive.rig().body_from_lidar;
    for kind in ["velodyne", "times", "rings"] {
        fs::create_dir_all(out.join(kind))?;
    }
    let mut stamps = String::new();
    let mut poses = String::new();
    let mut labelled = Vec::new();
    let mut source = drive.sweeps()?;
    let mut n_sweeps = 0;
    loop {
        let mut returns: Vec<SweepPoint> = Vec::new();
        let Some(sweep) = source.next_sweep(|piece| returns.extend_from_slice(piece))? else { break };
        if sweep.turn < 0.95 || returns.is_empty() {
            continue;
        }
        let name = format!("{n_sweeps:06}");
        write_returns(out, &name, &returns, sweep.has_times)?;
        stamps.push_str(&sweep.stamp.0.to_string());
        stamps.push('\n');
        if let Some(truth) = &truth {
            let last = returns.iter().map(|point| point.offset_nanos).max().unwrap_or(0);
            let at = |nanos: u32| pose_at(truth, &sweep, nanos);
            let begin = at(0)?;
            let end = at(last)?;
            poses.push_str(&kitti_line(&(end * body_from_lidar)));
            if let Some(movers) = &mut movers {
                let instances = instances(&drive, &sweep, returns.len())?;
                let observation = |(point, &instance): (&SweepPoint, &u16)| {
                    let share = f64::from(point.offset_nanos) / f64::from(last.max(1));
                    let pose = interpolate(&begin, &end, share) * body_from_lidar;
                    let place = pose * nalgebra::Point3::new(point.x, point.y, point.z).cast::<f64>();
                    (instance, [place.coords, pose.translation.vector])
                };
                movers.add(sweep.stamp, returns.iter().zip(&instances).map(observation));
                labelled.push((name, instances));
            }
        }
        n_sweeps += 1;
    }
    fs::write(out.join("stamps.txt"), stamps)?;
    fs::write(out.join("mounting.txt"), kitti_line(&body_from_lidar))?;
    if truth.is_some() {
        fs::write(out.join("poses.txt"), poses)?;
    }
    write_sensors(&drive, out)?;
    let moving = movers.map(|movers| movers.moving()).unwrap_or_default();
    for (name, instances) in labelled {
        fs::create_dir_all(out.join("moving"))?;
        let flags: Vec<u8> = instances.iter().map(|instance| u8::from(moving.contains(instance))).collect();
        write_npy(&out.join("moving").join(format!("{name}.npy")), flags)?;
    }
    println!("{}: {n_sweeps} sweeps, {} moving objects", out.display(), moving.len());
    Ok(())
}

fn write_returns(out: &Path, name: &str, returns: &[SweepPoint], has_times: bool) -> anyhow::Result<()> {
    let numbers = returns.iter().flat_map(|p| [p.x, p.y, p.z, f32::from(p.intensity)]);
    fs::write(out.join(format!("velodyne/{name}.bin")), numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())?;
    if has_times {
        let times: Vec<f64> = returns.iter().map(|point| f64::from(point.offset_nanos) * 1e-9).collect();
        write_npy(&out.join(format!("times/{name}.npy")), times)?;
        write_npy(&out.join(format!("rings/{name}.npy")), returns.iter().map(|point| point.ring).collect())?;
    }
    Ok(())
}

/// Writes a row of numbers as an array of `NumPy`.
fn write_npy<T: WithDType>(path: &Path, numbers: Vec<T>) -> anyhow::Result<()> {
    let n = numbers.len();
    Tensor::from_vec(numbers, n, &Device::Cpu)?.write_npy(path).with_context(|| path.display().to_string())
}

/// The measurements of inertial unit and receiver.
fn write_sensors(drive: &Drive, out: &Path) -> anyhow::Result<()> {
    let manifest = drive.manifest();
    let places = [
        manifest.imu.as_ref().map_or([0.0; 3], |imu| imu.mounting().translation.vector.into()),
        manifest.gnss.as_ref().map_or([0.0; 3], |gnss| gnss.antenna_in_body),
    ];
    fs::write(out.join("places.txt"), places.map(|[x, y, z]| format!("{x} {y} {z}\n")).concat())?;
    if let Some(samples) = drive.imu()? {
        let samples: Vec<_> = samples.filter_map(Result::ok).collect();
        fs::write(out.join("imu.csv"), drive::imu::csv_from_samples(&samples))?;
    }
    let (fixes, _) = drive.fixes()?;
    let velocities = fixes.iter().filter_map(|fix| {
        let velocity = GroundVelocity::new(fix.stamp, fix.speed_mps?, fix.course_deg, fix.hdop)?;
        let [east, north] = velocity.east_north;
        Some(format!("{},{east},{north},{}\n", velocity.stamp.0, velocity.sigma))
    });
    Ok(fs::write(out.join("velocities.csv"), velocities.collect::<String>())?)
}

fn pose_at(truth: &Trajectory, sweep: &SweepInfo, nanos: u32) -> anyhow::Result<Pose> {
    let stamp = sweep.stamp.plus_nanos(i64::from(nanos));
    truth.at(stamp).with_context(|| format!("the true trajectory has no pose at {} ns", stamp.0))
}

/// The instance of each return of a labelled drive.
fn instances(drive: &Drive, sweep: &SweepInfo, n_returns: usize) -> anyhow::Result<Vec<u16>> {
    let truth = drive.manifest().truth.as_ref().context("the drive has no truth")?;
    let path = drive
        .folder()
        .join(truth.labels.as_ref().context("the drive has no labels")?)
        .join(format!("{:06}.label", sweep.seq));
    let labels = formats::kitti::labels_from_bytes(&fs::read(&path).with_context(|| path.display().to_string())?)?;
    anyhow::ensure!(labels.len() == n_returns, "{}: {} labels for {n_returns}", path.display(), labels.len());
    Ok(labels.iter().map(|label| label.instance).collect())
}

/// Finds the instances of a simulated drive that move: rays test whether their points are still there a second later.
struct Movers {
    simulation: Simulation,
    /// Points that were gone and points that were still there, by instance.
    votes: BTreeMap<u16, (u32, u32)>,
}

/// Largest number of points of an instance that are tested in each sweep.
const MAX_TESTED: usize = 8;

impl Movers {
    /// Adds instances with the position of a point and of the LiDAR at `stamp`.
    fn add(&mut self, stamp: Stamp, points: impl Iterator<Item = (u16, [Vector3<f64>; 2])>) {
        let later = stamp.seconds_since(self.simulation.motion.begin) + 1.0;
        let snapshot = self.simulation.scene.at(later);
        let mut n_tested: BTreeMap<u16, usize> = BTreeMap::new();
        for (instance, [place, from]) in points.filter(|(instance, _)| *instance != 0) {
            let n = n_tested.entry(instance).or_default();
            if *n == MAX_TESTED {
                continue;
            }
            *n += 1;
            let direction = (place - from).normalize();
            // Ten times the noise in front and behind.
            let ray = Ray { origin: (place - direction * 0.2).cast(), direction: direction.cast(), seed: 0 };
            let is_there =
                (self.simulation.scene.cast(&snapshot, &ray, 0.4)).is_some_and(|hit| hit.surface.instance == instance);
            let (gone, still) = self.votes.entry(instance).or_default();
            *if is_there { still } else { gone } += 1;
        }
    }
    fn moving(&self) -> Vec<u16> {
        self.votes.iter().filter(|(_, (gone, still))| gone > still).map(|(instance, _)| *instance).collect()
    }
}
