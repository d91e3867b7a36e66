//! Folders of sweeps, with stamps, poses and IMU samples from files next to them. The body frame is the LiDAR frame.

mod cloud_sweep;
mod stamp_table;

use crate::error::{At, ImportError};
use crate::files::files;
use crate::imu_table;
use crate::imu_units::to_metric;
use crate::plan::{Conversion, Converted, Plan, TextFile};
use crate::rows::{self, Rows};
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use crate::{Kind, Options};
use cloud_sweep::{Read, form_of, pcd, read_las, read_pcd, read_ply};
use drive::imu::csv_from_samples;
use drive::manifest::{ImuEntry, LidarEntry, PoseEntry};
use files::names::natural_order;
use files::text_file::read_long_text;
use formats::cloud_fields::{CloudForm, MapOrigin};
use formats::trajectory::TrajectoryFile;
use geometry::Trajectory;
use lidar::{Model, velodyne};
use stamp_table::stamped;
use std::path::{Path, PathBuf};

/// Names of trajectories. `registered_poses.csv` is used by Newer College.
const TRAJECTORIES: [&str; 5] =
    ["trajectory.txt", "groundtruth.txt", "ground_truth.txt", "registered_poses.csv", "poses.txt"];

/// The drive of a folder of `*.bin`, `*.pcd` or `*.ply`.
pub(crate) fn plan(kind: Kind, source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let mut sweeps = files(source, &format!(".{}", kind.name()))?;
    if kind == Kind::Las {
        sweeps.extend(files(source, ".laz")?);
        sweeps.sort_by(|a, b| natural_order(&a.0, &b.0));
    }
    let found = stamped(source, sweeps)?;
    let mut originals = Sweeps { files: found.files, times: found.times };
    originals.check(source)?;
    if kind == Kind::Bin {
        rows::check(&originals.files, Rows::kitti(options.kind.is_some()))?;
    }
    let model = options.model.unwrap_or(velodyne::Model::Hdl64e.into());
    let format = if kind == Kind::Bin { "bin" } else { "pcd" };
    let lidar = LidarEntry::new(model.name(), format, LIDAR_FOLDER, PoseEntry::IDENTITY);
    let read: Option<Read> = match kind {
        Kind::Pcd => Some(read_pcd),
        Kind::Ply => Some(read_ply),
        Kind::Las => Some(read_las),
        _ => None,
    };
    // Files of PCD are links, which a run reads by the same rules.
    let form = match read {
        Some(read) if kind != Kind::Pcd => {
            let files: Vec<&Path> = originals.files.iter().map(|(_, path)| path.as_path()).collect();
            Some(form_of(&files, originals.times.as_deref(), interval_s(&originals), model, read)?)
        }
        _ => None,
    };
    let stamps = originals.times.clone().unwrap_or_else(|| vec![0; originals.files.len()]);
    let shift_nanos = form.as_ref().map_or(0, CloudForm::shift_nanos);
    originals.times.iter_mut().flatten().for_each(|time| *time += shift_nanos);
    let mut plan = numbered(&originals).plan(kind, &crate::drive_name(source, kind), lidar);
    plan.report.extend(found.note);
    plan.read.extend(found.table);
    if let (Some(form), Some(read)) = (form, read) {
        convert(&mut plan, &form, &stamps, read);
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

/// Drives read their sweeps in the order of the names. Names are kept if their order is the order of the stamps.
fn numbered(sweeps: &Sweeps) -> Sweeps {
    let name = |(number, (name, path)): (usize, &(String, PathBuf))| (format!("{number:06}_{name}"), path.clone());
    let files = if sweeps.files.is_sorted_by(|a, b| natural_order(&a.0, &b.0).is_le()) {
        sweeps.files.clone()
    } else {
        sweeps.files.iter().enumerate().map(name).collect()
    };
    Sweeps { files, times: sweeps.times.clone() }
}

fn assumed(model: Model) -> String {
    format!("the files do not name the LiDAR: {} is assumed, --model sets another", model.name())
}

/// The first of these names in the folder of the sweeps, otherwise in the folder above.
fn find_file(source: &Path, names: &[&str]) -> Result<Option<PathBuf>, ImportError> {
    let absolute = source.canonicalize().at(source)?;
    let folders = [Some(absolute.as_path()), absolute.parent()].into_iter().flatten();
    Ok(folders.flat_map(|folder| names.iter().map(|name| folder.join(name))).find(|path| path.is_file()))
}

/// Shortest time from one stamp to the next, s; `None` for a single sweep. Without stamps a drive has 10 sweeps per second.
fn interval_s(sweeps: &Sweeps) -> Option<f64> {
    let intervals = sweeps.times.as_ref().map(|times| times.windows(2).map(|pair| (pair[1] - pair[0]) as f64 * 1e-9));
    match intervals {
        Some(intervals) => intervals.reduce(f64::min),
        None => (sweeps.files.len() > 1).then_some(0.1),
    }
}

/// Plans the conversion of the files to PCD: the drive format supports no other format for them. `stamps`: stamps of the source.
fn convert(plan: &mut Plan, form: &CloudForm, stamps: &[i64], read: Read) {
    plan.report.push("the files are converted to PCD".into());
    plan.report.extend(form.report.iter().cloned());
    plan.report.extend(form.viewpoint_line());
    plan.manifest.lidar.map_origin = form.origin.map(|MapOrigin(origin)| origin);
    for (link, stamp) in std::mem::take(&mut plan.links).into_iter().zip(stamps) {
        let original = link.original.clone();
        let form = form.clone();
        let stamp = *stamp;
        let content = move || {
            let cloud = read(&original)?;
            let bytes = pcd(&form, &cloud, stamp).map_err(|rule| ImportError::at(&original, rule))?;
            Ok(Converted { bytes, flags: cloud.flags })
        };
        plan.conversions.push(Conversion {
            place: link.place.with_extension("pcd"),
            originals: vec![link.original],
            content: Box::new(content),
        });
    }
}

/// Adds poses with stamps as the true poses of the LiDAR. Poses without stamps often belong to a camera and are not
/// imported.
fn add_truth(plan: &mut Plan, source: &Path, sweeps: &Sweeps) -> Result<(), ImportError> {
    let Some(path) = find_file(source, &TRAJECTORIES)? else { return Ok(()) };
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
        "imported: {} true poses of {}, taken as poses of the LiDAR",
        poses.len(),
        path.display()
    ));
    plan.read.push(path);
    Ok(())
}

/// Reads rows of seconds, ns, x y z and the quaternion x y z w, after a header.
fn newer_college(path: &Path) -> Result<Trajectory, ImportError> {
    let text = read_long_text(path).at(path)?;
    let mut tum = String::new();
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        let is_header = number == 1 && line.contains(|c: char| c.is_ascii_alphabetic());
        if is_header || line.is_empty() || line.starts_with('#') {
            // A comment keeps the line numbers, and the order of the quaternion that a header names.
            tum.extend(["#", &line.replace(',', " "), "\n"]);
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
    let Some(path) = find_file(source, &["imu.csv", "imu.txt"])? else { return Ok(()) };
    let mut samples = imu_table::read(&path)?;
    let note = to_metric(&mut samples).map_err(|rule| ImportError::at(&path, rule))?;
    plan.report.push(format!("imported: {} IMU samples of {}{note}", samples.len(), path.display()));
    plan.report.push(
        "the IMU is assumed to have the axes and the position of the LiDAR; set [imu] body_from_imu otherwise".into(),
    );
    plan.texts.push(TextFile { place: "imu.csv".into(), text: csv_from_samples(&samples) });
    plan.manifest.imu =
        Some(ImuEntry { delay_nanos: 0, file: "imu.csv".into(), position_in_body: [0.0; 3], body_from_imu: None });
    plan.read.push(path);
    Ok(())
}
