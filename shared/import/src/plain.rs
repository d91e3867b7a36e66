//! Folders of sweeps, with stamps, poses and IMU samples if files beside them have some. The body frame is that of the LiDAR.

mod imu_table;
mod stamp_table;
mod stamp_text;

use crate::error::{At, ImportError};
use crate::files::files;
use crate::las::each_block;
use crate::plan::{Conversion, Plan, TextFile};
use crate::rows::{self, Rows};
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use crate::{Kind, Options};
use formats::cloud::CloudPoint;
use formats::lidar::Model;
use formats::manifest::{ImuEntry, LidarEntry, PoseEntry};
use formats::pcd::pcd_from_points;
use formats::ply::Vertices;
use formats::trajectory::TrajectoryFile;
use formats::velodyne;
use geometry::Trajectory;
use stamp_table::stamped;
use std::path::{Path, PathBuf};

/// Names of trajectories. `registered_poses.csv` is that of Newer College.
const TRAJECTORIES: [&str; 5] =
    ["trajectory.txt", "groundtruth.txt", "ground_truth.txt", "registered_poses.csv", "poses.txt"];
/// Coordinates beyond this are those of a map, m: no LiDAR measures so far.
const MAX_COORDINATE_M: f32 = 10_000.0;
/// Names of the column of intensities of a PLY file.
const INTENSITIES: [&str; 5] = ["intensity", "scalar_intensity", "scalar_Intensity", "reflectance", "reflectivity"];

/// The drive of a folder of `*.bin`, `*.pcd` or `*.ply`.
pub(crate) fn plan(kind: Kind, source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let mut sweeps = files(source, &format!(".{}", kind.name()))?;
    if kind == Kind::Las {
        sweeps.extend(files(source, ".laz")?);
        sweeps.sort();
    }
    let found = stamped(source, sweeps)?;
    let originals = Sweeps { files: found.files, times: found.times };
    originals.check(source)?;
    if kind == Kind::Bin {
        rows::check(&originals.files, Rows::of_kitti(options.kind.is_some()))?;
    }
    let model = options.model.unwrap_or(velodyne::Model::Hdl64e.into());
    let format = if kind == Kind::Bin { "bin" } else { "pcd" };
    let lidar = LidarEntry::new(model.name(), format, LIDAR_FOLDER, PoseEntry::IDENTITY);
    let mut plan = numbered(&originals).plan(kind, &crate::drive_name(source, kind), lidar);
    plan.read.extend(found.table);
    match kind {
        Kind::Ply => convert(&mut plan, pcd_of_ply),
        Kind::Las => convert(&mut plan, pcd_of_las),
        _ => {}
    }
    if options.model.is_none() {
        plan.report.push(assumed(model));
    }
    if !options.lidar_only {
        add_truth(&mut plan, source, &originals)?;
        add_imu(&mut plan, source)?;
    }
    Ok(plan)
}

/// Drives read their sweeps in the order of the names. Names that are in the order of the stamps are kept.
fn numbered(sweeps: &Sweeps) -> Sweeps {
    let name = |(number, (name, path)): (usize, &(String, PathBuf))| (format!("{number:06}_{name}"), path.clone());
    let files = if sweeps.files.is_sorted() {
        sweeps.files.clone()
    } else {
        sweeps.files.iter().enumerate().map(name).collect()
    };
    Sweeps { files, times: sweeps.times.clone() }
}

fn assumed(model: Model) -> String {
    format!("the files do not name the LiDAR: {} is assumed, --model sets another", model.name())
}

/// The first of the names in the folder of the sweeps, else in the one above it.
fn beside(source: &Path, names: &[&str]) -> Result<Option<PathBuf>, ImportError> {
    let absolute = source.canonicalize().at(source)?;
    let folders = [Some(absolute.as_path()), absolute.parent()].into_iter().flatten();
    Ok(folders.flat_map(|folder| names.iter().map(|name| folder.join(name))).find(|path| path.is_file()))
}

/// The files become PCD files: the drive format has no others.
fn convert(plan: &mut Plan, pcd: fn(&Path) -> Result<Vec<u8>, ImportError>) {
    for link in std::mem::take(&mut plan.links) {
        let original = link.original.clone();
        plan.conversions.push(Conversion {
            place: link.place.with_extension("pcd"),
            originals: vec![link.original],
            bytes: Box::new(move || pcd(&original)),
        });
    }
    plan.report.push("the files are converted to PCD, without rings and times of points".into());
}

fn pcd_of_ply(path: &Path) -> Result<Vec<u8>, ImportError> {
    let file = std::fs::read(path).at(path)?;
    // The errors of the reader name the file.
    let cloud = Vertices::decode(file, Path::new("PLY")).at(path)?;
    let [xs, ys, zs] = ["x", "y", "z"].map(|name| cloud.f32s(name));
    let (xs, ys, zs) = (xs.at(path)?, ys.at(path)?, zs.at(path)?);
    let column = INTENSITIES.iter().find(|name| cloud.has(name));
    let intensities = column.map(|name| cloud.f32s(name)).transpose().at(path)?.unwrap_or_else(|| vec![0.0; xs.len()]);
    let rows = xs.into_iter().zip(ys).zip(zs).zip(intensities);
    let points: Vec<CloudPoint> = rows.map(|(((x, y), z), intensity)| CloudPoint { x, y, z, intensity }).collect();
    Ok(pcd_from_points(&points))
}

fn pcd_of_las(path: &Path) -> Result<Vec<u8>, ImportError> {
    let mut points = Vec::new();
    each_block(path, |block| {
        points.extend(block.iter().map(|found| found.point));
        Ok(())
    })?;
    if let Some(far) = points.iter().find(|p| [p.x, p.y, p.z].iter().any(|value| value.abs() > MAX_COORDINATE_M)) {
        let (x, y, z) = (far.x, far.y, far.z);
        return Err(ImportError::at(
            path,
            format!("a point is at {x} {y} {z} m; sweeps must be in the frame of the LiDAR"),
        ));
    }
    Ok(pcd_from_points(&points))
}

/// Poses with stamps are the truth, those of the LiDAR. Poses without stamps are often those of a camera, and not taken.
fn add_truth(plan: &mut Plan, source: &Path, sweeps: &Sweeps) -> Result<(), ImportError> {
    let Some(path) = beside(source, &TRAJECTORIES)? else { return Ok(()) };
    let is_csv = path.extension().is_some_and(|extension| extension == "csv");
    let found =
        if is_csv { Ok(TrajectoryFile::Stamped(newer_college(&path)?)) } else { TrajectoryFile::load(&path, None) };
    let trajectory = match found {
        Ok(TrajectoryFile::Stamped(trajectory)) => trajectory,
        Ok(TrajectoryFile::Numbered(_)) => {
            plan.report.push(format!("not imported: {}, poses without stamps", path.display()));
            return Ok(());
        }
        Err(problem) => {
            return Err(match problem.line {
                Some(line) => ImportError::at_line(&path, line, problem.rule),
                None => ImportError::at(&path, problem.rule),
            });
        }
    };
    let Some((first, last)) = sweeps.times.as_ref().and_then(|times| Some((*times.first()?, *times.last()?))) else {
        plan.report.push(format!("not imported: {}, the sweeps have no stamps", path.display()));
        return Ok(());
    };
    let poses = trajectory.poses();
    let overlaps = poses.first().is_some_and(|(stamp, _)| stamp.0 <= last)
        && poses.last().is_some_and(|(stamp, _)| stamp.0 >= first);
    if !overlaps {
        return Err(ImportError::at(
            &path,
            format!("no pose lies between the first and the last sweep, {first} and {last} ns"),
        ));
    }
    plan.add_truth(&trajectory, None);
    plan.report.push(format!(
        "imported: {} true poses of {}, taken as those of the LiDAR",
        poses.len(),
        path.display()
    ));
    plan.read.push(path);
    Ok(())
}

/// Rows of seconds, ns, x y z and the quaternion x y z w, behind a header.
fn newer_college(path: &Path) -> Result<Trajectory, ImportError> {
    let text = std::fs::read_to_string(path).at(path)?;
    let mut tum = String::new();
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        let is_header = number == 1 && line.contains(|c: char| c.is_ascii_alphabetic());
        if is_header || line.is_empty() || line.starts_with('#') {
            // Keeps the numbers of the lines.
            tum.push('\n');
            continue;
        }
        let (seconds, rest) = line.split_once(',').unwrap_or((line, ""));
        let (nanos, pose) = rest.split_once(',').unwrap_or((rest, ""));
        let nanos: Option<u32> = nanos.trim().parse().ok().filter(|nanos| *nanos < 1_000_000_000);
        let nanos = nanos.ok_or_else(|| {
            ImportError::at_line(path, number, format!("{line:?} must be sec,nsec,x,y,z,qx,qy,qz,qw"))
        })?;
        let words = [seconds.trim(), ".", &format!("{nanos:09}"), " ", &pose.replace(',', " "), "\n"];
        tum.extend(words);
    }
    formats::trajectory::trajectory_from_tum(&tum).at(path)
}

fn add_imu(plan: &mut Plan, source: &Path) -> Result<(), ImportError> {
    let Some(path) = beside(source, &["imu.csv", "imu.txt"])? else { return Ok(()) };
    let table = imu_table::read(&path)?;
    plan.report.push(format!("imported: {} IMU samples of {}{}", table.n_samples, path.display(), table.note));
    plan.report
        .push("axes and place of the IMU are taken as those of the LiDAR; [imu] body_from_imu sets others".into());
    plan.texts.push(TextFile { place: "imu.csv".into(), text: table.text });
    plan.manifest.imu = Some(ImuEntry { file: "imu.csv".into(), position_in_body: [0.0; 3], body_from_imu: None });
    plan.read.push(path);
    Ok(())
}
