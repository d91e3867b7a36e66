//! KITTI raw: a drive of the "synced+rectified" download, with the calibration of its day.
//!
//! The body frame is the frame of the GNSS and IMU unit; without its records, the LiDAR frame.

use super::calibration::Calibration;
use super::sweeps::{self, lidar};
use super::{CAMERA_CHOICES, EXPOSURE_NANOS, oxts};
use crate::cameras::{self, Camera, image_size};
use crate::error::{At, ImportError};
use crate::files::{files, image_end};
use crate::numbered::Stamps;
use crate::plan::Plan;
use crate::times::nanos_of_date;
use crate::{Kind, Options};
use geometry::Pose;
use std::path::{Path, PathBuf};

/// The drive of a folder.
pub(crate) fn plan(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let velodyne = source.join("velodyne_points");
    let unit = source.join("oxts");
    let has_unit = !options.lidar_only && unit.is_dir();
    let numbers = if options.lidar_only { Vec::new() } else { camera_numbers(source)? };
    let needs_stamps = has_unit || !numbers.is_empty();
    let times = velodyne.join("timestamps.txt");
    let sweeps = sweeps::read(&velodyne.join("data"), &times, nanos_of_date, needs_stamps, options)?;
    let velo_from_imu = if has_unit { Some(calibration(source, "calib_imu_to_velo.txt")?) } else { None };
    let body_from_velo = match &velo_from_imu {
        Some(file) => file.transform()?.inverse(),
        None => Pose::identity(),
    };
    let name = crate::drive_name(source, Kind::KittiRaw);
    let mut plan = sweeps.sweeps.plan(Kind::KittiRaw, &name, lidar(options, body_from_velo));
    plan.report.extend(sweeps.notes);
    plan.read.extend(sweeps.times);
    plan.read.extend(velo_from_imu.map(|file| file.path().to_owned()));
    if !numbers.is_empty() {
        let velo_to_cam = calibration(source, "calib_velo_to_cam.txt")?;
        let cam_to_cam = calibration(source, "calib_cam_to_cam.txt")?;
        let rectified_from_velo = cam_to_cam.rotation("R_rect_00")? * velo_to_cam.transform()?;
        let body_from_rectified = body_from_velo * rectified_from_velo.inverse();
        let mut found = Vec::new();
        for number in numbers {
            found.push(camera(source, number, &cam_to_cam, &body_from_rectified, &mut plan.read)?);
        }
        cameras::add(&mut plan, found)?;
        plan.read.extend([velo_to_cam, cam_to_cam].map(|file| file.path().to_owned()));
    }
    if has_unit {
        let times = unit.join("timestamps.txt");
        oxts::read(&unit, &Stamps::read(&times, nanos_of_date)?)?.add_to(&mut plan, "oxts");
        plan.read.push(times);
        plan.read.extend(files(&unit.join("data"), ".txt")?.into_iter().map(|(_, path)| path));
        plan.report
            .push("the body frame is the frame of the GNSS and IMU unit; heights are taken from its records".into());
    }
    Ok(plan)
}

/// Numbers of the cameras to import: the color cameras if there are any.
fn camera_numbers(source: &Path) -> Result<Vec<usize>, ImportError> {
    for choice in CAMERA_CHOICES {
        let mut found = Vec::new();
        for number in choice {
            if image_end(&images(source, number))?.is_some() {
                found.push(number);
            }
        }
        if !found.is_empty() {
            return Ok(found);
        }
    }
    Ok(Vec::new())
}

fn images(source: &Path, number: usize) -> PathBuf {
    source.join(format!("image_{number:02}/data"))
}

fn camera(
    source: &Path,
    number: usize,
    calibration: &Calibration,
    body_from_rectified: &Pose,
    read: &mut Vec<PathBuf>,
) -> Result<Camera, ImportError> {
    let name = format!("image_{number:02}");
    let times = source.join(&name).join("timestamps.txt");
    let stamps = Stamps::read(&times, nanos_of_date)?;
    let folder = images(source, number);
    let stamped = stamps.files(&folder, image_end(&folder)?.unwrap_or(".png"))?;
    read.push(times);
    let projection = calibration.projection(&format!("P_rect_{number:02}"))?;
    let size = calibration.numbers::<2>(&format!("S_rect_{number:02}"))?.map(|side| side as u32);
    if let Some(first) = stamped.first() {
        let [width, height] = image_size(&first.path)?;
        if [width, height] != size {
            let [w, h] = size;
            let file = calibration.path().display();
            let rule = format!(
                "{width} x {height} px, but {file} has rectified images of {w} x {h}; use the synced and rectified download"
            );
            return Err(ImportError::at(&first.path, rule));
        }
    }
    Ok(Camera {
        name,
        exposure_nanos: EXPOSURE_NANOS,
        body_from_camera: body_from_rectified * projection.rectified_from_camera,
        model: projection.model(size),
        n_absent: stamps.len() - stamped.len(),
        images: stamped.into_iter().map(|file| (file.stamp, file.path)).collect(),
    })
}

/// A calibration file of the day: in the folder of the drive or, as downloaded, in the folder above.
fn calibration(source: &Path, name: &str) -> Result<Calibration, ImportError> {
    let absolute = source.canonicalize().at(source)?;
    let folders = [Some(absolute.as_path()), absolute.parent()];
    let path = folders.into_iter().flatten().map(|folder| folder.join(name)).find(|path| path.is_file());
    let path = path.ok_or_else(|| {
        let rule = format!(
            "{name} is neither here nor in the folder above; it is in the calibration download of the day. --lidar-only imports \
             the sweeps alone"
        );
        ImportError::at(source, rule)
    })?;
    Calibration::read(&path)
}
