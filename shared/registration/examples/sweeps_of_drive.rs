//! The sweeps of a drive as a folder that other people's odometries read (`folder/mod.rs` has the layout):
//! `sweeps_of_drive DRIVE OUT`, or `sweeps_of_drive --simulate SEED SECONDS OUT` for a simulated urban drive with the
//! lidar alone.

mod folder;

use anyhow::Context;
use folder::{kitti_line, npy};
use formats::drive::{Drive, DriveSweep};
use formats::velodyne::LidarReturn;
use geometry::{Pose, Trajectory, Vector3, interpolate};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--simulate", seed, seconds, out] => {
            let spec = simulation::DriveSpec::urban(seed.parse()?, seconds.parse()?);
            let spec = simulation::DriveSpec { cameras: false, mosaics: false, ..spec };
            let drive = Path::new(out).join("drive");
            fs::create_dir_all(out)?;
            simulation::write_drive(&spec, &drive, &mut |_| {})?;
            write(&drive, Path::new(out))
        }
        [drive, out] => write(Path::new(drive), Path::new(out)),
        _ => anyhow::bail!("usage: sweeps_of_drive (DRIVE | --simulate SEED SECONDS) OUT"),
    }
}

fn write(drive: &Path, out: &Path) -> anyhow::Result<()> {
    let drive = Drive::open(drive)?;
    let truth = drive.true_trajectory().transpose().map_err(|problem| anyhow::anyhow!("{problem}"))?;
    let body_from_lidar = drive.rig().body_from_lidar;
    for kind in ["velodyne", "times", "rings"] {
        fs::create_dir_all(out.join(kind))?;
    }
    let (mut stamps, mut poses, mut things) = (String::new(), String::new(), Things::default());
    let mut labelled = Vec::new();
    let mut source = drive.sweeps()?;
    let mut n_sweeps = 0;
    loop {
        let mut returns: Vec<LidarReturn> = Vec::new();
        let Some(sweep) = source.next_sweep(|piece| returns.extend_from_slice(piece))? else { break };
        if sweep.turn < 0.95 || returns.is_empty() {
            continue;
        }
        let name = format!("{n_sweeps:06}");
        write_returns(out, &name, &returns, sweep.has_times)?;
        stamps.push_str(&format!("{}\n", sweep.stamp.0));
        if let Some(truth) = &truth {
            let last = returns.iter().map(|point| point.offset_nanos).max().unwrap_or(0);
            let at = |nanos: u32| pose_at(truth, &sweep, nanos);
            let (begin, end) = (at(0)?, at(last)?);
            poses.push_str(&kitti_line(&(end * body_from_lidar)));
            if let Some(instances) = instances(&drive, &sweep, returns.len())? {
                let place = |point: &LidarReturn| {
                    let pose = interpolate(&begin, &end, f64::from(point.offset_nanos) / f64::from(last.max(1)));
                    pose * body_from_lidar * nalgebra::Point3::new(point.x, point.y, point.z).cast::<f64>()
                };
                things.see(returns.iter().zip(&instances).map(|(point, &instance)| (instance, place(point).coords)));
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
    let moving = things.moving();
    for (name, instances) in labelled {
        fs::create_dir_all(out.join("moving"))?;
        let flags: Vec<u8> = instances.iter().map(|instance| u8::from(moving.contains(instance))).collect();
        fs::write(out.join("moving").join(format!("{name}.npy")), npy::of_bytes(&flags))?;
    }
    println!("{}: {n_sweeps} sweeps, {} moving things", out.display(), moving.len());
    Ok(())
}

fn write_returns(out: &Path, name: &str, returns: &[LidarReturn], has_times: bool) -> anyhow::Result<()> {
    let numbers = returns.iter().flat_map(|p| [p.x, p.y, p.z, f32::from(p.intensity)]);
    fs::write(out.join(format!("velodyne/{name}.bin")), numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())?;
    if has_times {
        let times: Vec<f64> = returns.iter().map(|point| f64::from(point.offset_nanos) * 1e-9).collect();
        fs::write(out.join(format!("times/{name}.npy")), npy::of_f64s(&times))?;
        let rings: Vec<u8> = returns.iter().map(|point| point.ring).collect();
        fs::write(out.join(format!("rings/{name}.npy")), npy::of_bytes(&rings))?;
    }
    Ok(())
}

fn pose_at(truth: &Trajectory, sweep: &DriveSweep, nanos: u32) -> anyhow::Result<Pose> {
    let stamp = sweep.stamp.plus_nanos(i64::from(nanos));
    truth.at(stamp).with_context(|| format!("the true trajectory has no pose at {}", stamp.0))
}

/// The instance of each return, where the drive is labelled.
fn instances(drive: &Drive, sweep: &DriveSweep, n_returns: usize) -> anyhow::Result<Option<Vec<u16>>> {
    let Some(folder) = drive.manifest().truth.as_ref().map(|truth| &truth.labels) else { return Ok(None) };
    let path: PathBuf = drive.folder().join(folder).join(format!("{:06}.label", sweep.seq));
    let labels = formats::kitti::labels_from_bytes(&fs::read(&path).with_context(|| path.display().to_string())?)?;
    anyhow::ensure!(labels.len() == n_returns, "{}: {} labels for {n_returns}", path.display(), labels.len());
    Ok(Some(labels.iter().map(|label| label.instance).collect()))
}

/// How far the points of each instance reach.
#[derive(Default)]
struct Things {
    by_instance: BTreeMap<u16, Reach>,
}

#[derive(Clone)]
struct Reach {
    all: Bounds,
    largest_m: f64,
    n_sweeps: usize,
}

#[derive(Clone, Copy)]
struct Bounds([Vector3<f64>; 2]);

impl Bounds {
    fn around(point: Vector3<f64>) -> Self {
        Self([point, point])
    }
    fn with(self, other: Self) -> Self {
        Self([self.0[0].inf(&other.0[0]), self.0[1].sup(&other.0[1])])
    }
    fn diagonal_m(self) -> f64 {
        (self.0[1] - self.0[0]).xy().norm()
    }
}

impl Things {
    fn see(&mut self, points: impl Iterator<Item = (u16, Vector3<f64>)>) {
        let mut now: BTreeMap<u16, Bounds> = BTreeMap::new();
        for (instance, point) in points.filter(|(instance, _)| *instance != 0) {
            let point = Bounds::around(point);
            now.entry(instance).and_modify(|bounds| *bounds = bounds.with(point)).or_insert(point);
        }
        for (instance, bounds) in now {
            let reach = self.by_instance.entry(instance).or_insert(Reach { all: bounds, largest_m: 0.0, n_sweeps: 0 });
            reach.all = reach.all.with(bounds);
            reach.largest_m = reach.largest_m.max(bounds.diagonal_m());
            reach.n_sweeps += 1;
        }
    }
    /// Instances that reach farther over the drive than any single look at them by more than seeing another side of a
    /// standing thing explains.
    fn moving(&self) -> Vec<u16> {
        let is_moving = |reach: &Reach| reach.all.diagonal_m() > 1.4 * reach.largest_m + 0.7;
        self.by_instance.iter().filter(|(_, reach)| is_moving(reach)).map(|(instance, _)| *instance).collect()
    }
}
