//! The exact town of a simulated drive, in the place where a run of the drive put it.

use anyhow::{Context, ensure};
use drive::Drive;
use geometry::{Isometry3, Point3, Pose, Trajectory, UnitQuaternion, Vector3};
use nalgebra::Matrix3;
use raytrace::{Ray, Vec3};
use simulation::{DriveSettings, SimulatedDrive, Simulation};
use std::path::Path;
use town::SceneHit;

/// The exact town.
pub struct ExactTown {
    /// Its simulation.
    pub simulation: Simulation,
    /// Heading and translation from the path of the run to the true path, so that errors of GNSS do not count.
    pub town_from_run: Pose,
}

impl ExactTown {
    /// The town of a simulated drive. `path`: the path of a run of this drive.
    ///
    /// # Errors
    /// If the drive is not simulated, or the path has no times in common with the true one.
    pub fn open(drive: &Path, path: &Trajectory) -> anyhow::Result<Self> {
        let mark = SimulatedDrive::read(drive).with_context(|| format!("{}: not simulated", drive.display()))?;
        let mut settings = DriveSettings {
            town: mark.town.parse()?,
            seed: mark.seed,
            seconds: mark.seconds,
            pass: mark.pass,
            ..DriveSettings::default()
        };
        if let Some(traffic) = &mark.traffic {
            settings.traffic = traffic.parse()?;
        }
        let truth = Drive::open(drive)?.true_trajectory().context("has no truth")?;
        let truth = truth.map_err(|problem| anyhow::anyhow!("{problem}"))?;
        Ok(Self { simulation: Simulation::new(&settings.spec()?)?, town_from_run: aligned(path, &truth)? })
    }

    /// What a ray straight down from a place of the town meets within `reach_m`, without moving objects.
    pub fn below(&self, from: &Point3<f64>, reach_m: f64) -> Option<SceneHit> {
        let scene = &self.simulation.scene;
        let origin = Vec3::new(from.x as f32, from.y as f32, from.z as f32);
        let ray = Ray { origin, direction: Vec3::new(0.0, 0.0, -1.0), seed: 0 };
        scene.cast(&scene.some_at(&[], 0.0), &ray, reach_m as f32)
    }
}

/// Heading and translation from the run to the truth.
fn aligned(run: &Trajectory, truth: &Trajectory) -> anyhow::Result<Pose> {
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = run
        .poses()
        .iter()
        .filter_map(|(stamp, pose)| Some((pose.translation.vector, truth.at(*stamp)?.translation.vector)))
        .collect();
    ensure!(pairs.len() > 1, "the run and the truth have no times in common");
    let n = pairs.len() as f64;
    let from = pairs.iter().map(|(a, _)| a).sum::<Vector3<f64>>() / n;
    let to = pairs.iter().map(|(_, b)| b).sum::<Vector3<f64>>() / n;
    let [mut cos, mut sin] = [0.0; 2];
    for (a, b) in &pairs {
        let [a, b] = [a - from, b - to];
        cos += a.x * b.x + a.y * b.y;
        sin += a.x * b.y - a.y * b.x;
    }
    let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, sin.atan2(cos));
    Ok(Isometry3::from_parts((to - rotation * from).into(), rotation))
}

/// Height and slopes of the plane through heights at places: `[1, x, y]` times the result is the height of the plane.
pub fn plane(heights: impl Iterator<Item = [f64; 3]>) -> Vector3<f64> {
    let mut normal = Matrix3::<f64>::zeros();
    let mut right = Vector3::zeros();
    for [x, y, height] in heights {
        let row = Vector3::new(1.0, x, y);
        normal += row * row.transpose();
        right += row * height;
    }
    normal.lu().solve(&right).unwrap_or_default()
}
