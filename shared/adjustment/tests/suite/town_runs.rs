//! Runs of passes through a simulated town, with known errors of their poses.

use adjustment::{Submaps, Survey};
use delivery::{CloudEntry, Index};
use formats::ply::{Header, Kind, PlyWriter, Row};
use formats::trajectory::tum_from_trajectory;
use geometry::{Isometry3, Point3, Pose, Trajectory, UnitQuaternion, Vector3};
use random::Random;
use raytrace::{Ray, Vec3};
use simulation::{DriveSpec, Simulation};
use std::path::Path;
use surveying::RunFolder;

/// Length of a drive, and of a submap, s.
const SECONDS: f64 = 30.0;
const SUBMAP_SECONDS: f64 = 3.0;
/// Positions from which a submap is seen.
const VIEWS: usize = 6;
/// Directions of the rays of a view.
const AZIMUTHS: usize = 500;
const ELEVATIONS_DEG: [f64; 2] = [-25.0, 25.0];
const ELEVATIONS: usize = 28;
/// Standard deviation of ranges, m.
const NOISE_M: f32 = 0.01;
/// Position of the LiDAR above the body frame, m.
const LIDAR_M: f64 = 1.0;

/// A pass, and the error of its poses.
#[derive(Clone, Copy)]
pub struct Pass {
    pub town_seed: u64,
    pub pass: u64,
    /// Error of all positions, m.
    pub off_m: [f64; 3],
    /// Error of all headings, rad, about the origin of the world.
    pub turned_rad: f64,
    /// Stated standard deviation of a position, m.
    pub sigma_m: f32,
}

/// A written run, and the truth.
pub struct TownRun {
    pub simulation: Simulation,
    /// True poses of its submaps.
    pub true_poses: Vec<Pose>,
}

impl Pass {
    /// Error of the poses: it grows and shrinks by 5 cm along the drive, as errors of an odometry do.
    fn error(&self, seconds: f64) -> Pose {
        let [x, y, z] = self.off_m;
        let drift = 0.05 * (seconds / SECONDS * 3.0).sin();
        Isometry3::new(Vector3::new(x + drift, y - drift, z + drift), Vector3::z() * self.turned_rad)
    }

    /// Drives the pass and writes its run into a folder.
    pub fn write(&self, folder: &Path) -> TownRun {
        let spec = DriveSpec { pass: self.pass, ..DriveSpec::urban(self.town_seed, SECONDS) };
        let simulation = Simulation::new(&spec).expect("a town");
        std::fs::create_dir_all(folder.join("clouds")).expect("made");
        let begin = simulation.motion.begin;
        let mut trajectory = Trajectory::default();
        for k in 0..=(SECONDS * 10.0) as i64 {
            let seconds = k as f64 * 0.1;
            let stamp = begin.plus_nanos(k * 100_000_000);
            trajectory.push(stamp, self.error(seconds) * simulation.motion.pose(seconds));
        }
        let n = (SECONDS / SUBMAP_SECONDS) as usize;
        let mut true_poses = Vec::new();
        let entries: Vec<CloudEntry> = (0..n)
            .map(|seq| {
                let first_s = seq as f64 * SUBMAP_SECONDS;
                let body = simulation.motion.pose(first_s);
                let (_, _, yaw) = body.rotation.euler_angles();
                let true_pose =
                    Isometry3::from_parts(body.translation, UnitQuaternion::from_euler_angles(0.0, 0.0, yaw));
                true_poses.push(true_pose);
                self.write_cloud(&simulation, folder, seq, first_s, &self.error(first_s))
            })
            .collect();
        let entries: Vec<CloudEntry> = entries
            .into_iter()
            .zip(&true_poses)
            .enumerate()
            .map(|(seq, (entry, pose))| {
                let pose = self.error(seq as f64 * SUBMAP_SECONDS) * pose;
                CloudEntry {
                    translation: pose.translation.vector.into(),
                    rotation: pose.rotation.coords.into(),
                    ..entry
                }
            })
            .collect();
        std::fs::write(folder.join("clouds/index.json"), Index::new(&entries, "local").to_json()).expect("writes");
        std::fs::write(folder.join("trajectory.txt"), tum_from_trajectory(&trajectory)).expect("writes");
        let georeference = r#"{"frame":"local","trajectory_frame":"local",
            "origin":{"latitude_deg":48.846222,"longitude_deg":2.346414,"altitude_m":104.6}}"#;
        std::fs::write(folder.join("georeference.json"), georeference).expect("writes");
        TownRun { simulation, true_poses }
    }

    fn write_cloud(
        &self,
        simulation: &Simulation,
        folder: &Path,
        seq: usize,
        first_s: f64,
        error: &Pose,
    ) -> CloudEntry {
        let mut random = Random::for_hashed_stream(self.town_seed, self.pass << 16 | seq as u64);
        let mut points: Vec<(Point3<f64>, Point3<f64>, f64)> = Vec::new();
        for view in 0..VIEWS {
            let seconds = first_s + SUBMAP_SECONDS * view as f64 / VIEWS as f64;
            let lidar = simulation.motion.pose(seconds) * Isometry3::translation(0.0, 0.0, LIDAR_M);
            let snapshot = simulation.scene.at(seconds);
            let rays: Vec<Ray> = (0..AZIMUTHS * ELEVATIONS).map(|k| ray(&lidar, k, &mut random)).collect();
            let hits = simulation.scene.cast_all(&rays, 60.0, |_| &snapshot);
            for (ray, hit) in rays.iter().zip(hits) {
                let Some(hit) = hit else { continue };
                let at = ray.at(hit.range_m + NOISE_M * random.gauss());
                points.push((at.cast::<f64>().into(), lidar.translation.vector.into(), seconds));
            }
        }
        let file = format!("clouds/submap_{seq:04}.ply");
        let positions = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
        let header = Header::new(positions.map(|name| (name, Kind::Double)).into_iter().chain([
            ("timestamp", Kind::Double),
            ("index_frame", Kind::Int),
            ("intensity", Kind::UChar),
            ("ring", Kind::UChar),
            ("dynamic", Kind::UChar),
        ]));
        let mut writer = PlyWriter::create(&folder.join(&file), &header, points.len()).expect("creates");
        let begin = simulation.motion.begin;
        let encode = |i: usize, row: &mut Row<'_>| {
            let (p, lidar, seconds) = points[i];
            for p in [error * p, error * lidar] {
                row.f64(p.x).f64(p.y).f64(p.z);
            }
            row.f64(begin.0 as f64 * 1e-9 + seconds).i32((seconds * 10.0) as i32).u8(100).u8(0).u8(0);
        };
        writer.write_each(points.len(), encode).expect("writes");
        let bytes = writer.finish().expect("finishes");
        let stamp = |seconds: f64| begin.plus_nanos((seconds * 1e9) as i64).0;
        CloudEntry {
            seq: seq as u64,
            file,
            bytes,
            n_points: points.len() as u64,
            stamp_begin: stamp(first_s),
            stamp_end: stamp(first_s + SUBMAP_SECONDS),
            bounds: Some([[-1e3; 3], [1e3; 3]]),
            translation: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            sigma_m: Some([self.sigma_m; 3]),
            sigma_rad: Some([0.002, 0.002, 0.01]),
            n_colored: None,
            classes: None,
            n_instances: None,
            spectra: None,
            lost: Vec::new(),
        }
    }
}

fn ray(lidar: &Pose, k: usize, random: &mut Random) -> Ray {
    let azimuth = (k / ELEVATIONS) as f64 / AZIMUTHS as f64 * std::f64::consts::TAU;
    let [low, high] = ELEVATIONS_DEG;
    let share = ((k % ELEVATIONS) as f64 + f64::from(random.range(0.0, 1.0))) / ELEVATIONS as f64;
    let elevation = (low + (high - low) * share).to_radians();
    let direction = Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
    let origin: Vec3 = lidar.translation.vector.cast();
    Ray { origin, direction: (lidar.rotation * direction).cast(), seed: random.bits() }
}

/// Writes passes into subfolders, and reads their submaps.
pub fn submaps(folder: &Path, passes: &[Pass]) -> (Vec<TownRun>, Submaps) {
    let runs: Vec<TownRun> =
        passes.iter().enumerate().map(|(k, pass)| pass.write(&folder.join(k.to_string()))).collect();
    let named = (0..passes.len()).map(|k| {
        let run = RunFolder::open(&folder.join(k.to_string())).expect("opens");
        (format!("drive {k}"), run)
    });
    let submaps = Submaps::read(named.collect(), |_| ()).expect("reads");
    (runs, submaps)
}

/// Errors of the adjusted positions of the vehicle in the middle of each submap, m, drive by drive.
pub fn errors(runs: &[TownRun], submaps: &Submaps, survey: &Survey) -> Vec<Vec<Vector3<f64>>> {
    let mut errors = vec![Vec::new(); runs.len()];
    for (submap, pose) in submaps.all.iter().zip(&survey.after) {
        let p_in_submap = Point3::from(submap.keyframe.submap_from_body.translation.vector);
        let true_pose = runs[submap.drive].true_poses[submap.seq as usize];
        errors[submap.drive].push(pose * p_in_submap - true_pose * p_in_submap);
    }
    errors
}

/// Mean of vectors.
pub fn mean(errors: &[Vector3<f64>]) -> Vector3<f64> {
    errors.iter().sum::<Vector3<f64>>() / errors.len() as f64
}
