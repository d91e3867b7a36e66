//! KITTI odometry and SemanticKITTI: one sequence. The body frame is the LiDAR frame.

use super::calibration::Calibration;
use super::sweeps::{self, KittiSweeps, lidar};
use super::{CAMERA_CHOICES, EXPOSURE_NANOS, labels};
use crate::cameras::{self, Camera, image_size};
use crate::error::{At, ImportError};
use crate::files::image_end;
use crate::numbered::Stamps;
use crate::plan::Plan;
use crate::times::nanos_of_seconds;
use crate::{Kind, Options};
use files::text_file::read_long_text;
use formats::trajectory::poses_from_kitti;
use geometry::{Pose, Stamp, Trajectory};
use std::path::{Path, PathBuf};

/// Folder of the labels in the drive.
const LABELS: &str = "truth/labels";

/// The drive of a sequence.
pub(crate) fn plan(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let others = Others::find(source, options)?;
    let times = source.join("times.txt");
    let needs_stamps = !others.is_empty();
    let found = sweeps::read(&source.join("velodyne"), &times, nanos_of_seconds, needs_stamps, options)?;
    let name = crate::drive_name(source, Kind::KittiOdometry);
    let mut plan = found.sweeps.plan(Kind::KittiOdometry, &name, lidar(options, Pose::identity()));
    plan.report.extend(found.notes.iter().cloned());
    plan.read.extend(found.times.clone());
    if others.is_empty() {
        return Ok(plan);
    }
    let stamps = Stamps::read(&times, nanos_of_seconds)?;
    let calibration = if others.needs_calibration() { Some(calibration(source)?) } else { None };
    if let Some(calibration) = &calibration {
        let body_from_rectified = calibration.matrix("Tr")?.inverse();
        let camera = |number: &usize| camera(source, *number, &stamps, calibration, &body_from_rectified);
        cameras::add(&mut plan, others.cameras.iter().map(camera).collect::<Result<_, _>>()?)?;
        if let Some(poses) = &others.poses {
            add_truth(&mut plan, poses, &stamps, &body_from_rectified)?;
        }
        plan.read.push(calibration.path().to_owned());
    }
    if let Some(folder) = &others.labels {
        add_labels(&mut plan, folder, &found)?;
    }
    Ok(plan)
}

/// Data of a sequence in addition to its sweeps.
struct Others {
    cameras: Vec<usize>,
    poses: Option<PathBuf>,
    labels: Option<PathBuf>,
}

impl Others {
    fn find(source: &Path, options: &Options) -> Result<Self, ImportError> {
        let mut others = Self { cameras: Vec::new(), poses: None, labels: None };
        if options.lidar_only {
            return Ok(others);
        }
        for choice in CAMERA_CHOICES {
            for number in choice {
                if image_end(&source.join(format!("image_{number}")))?.is_some() {
                    others.cameras.push(number);
                }
            }
            if !others.cameras.is_empty() {
                break;
            }
        }
        others.poses = poses(source)?;
        others.labels = Some(source.join("labels")).filter(|folder| folder.is_dir());
        Ok(others)
    }

    fn is_empty(&self) -> bool {
        self.cameras.is_empty() && self.poses.is_none() && self.labels.is_none()
    }

    fn needs_calibration(&self) -> bool {
        !self.cameras.is_empty() || self.poses.is_some()
    }
}

/// The poses of the data set in `poses/07.txt` next to `sequences/07`, otherwise the poses that SemanticKITTI adds to the
/// sequence.
fn poses(source: &Path) -> Result<Option<PathBuf>, ImportError> {
    let absolute = source.canonicalize().at(source)?;
    let sequence = absolute.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let of_sequence = absolute.parent().and_then(Path::parent).map(|root| root.join(format!("poses/{sequence}.txt")));
    Ok([of_sequence, Some(absolute.join("poses.txt"))].into_iter().flatten().find(|path| path.is_file()))
}

fn calibration(source: &Path) -> Result<Calibration, ImportError> {
    let path = source.join("calib.txt");
    if !path.is_file() {
        let rule = "is absent; images and poses need it. --lidar-only imports the sweeps alone";
        return Err(ImportError::at(&path, rule));
    }
    Calibration::read(&path)
}

fn camera(
    source: &Path,
    number: usize,
    stamps: &Stamps,
    calibration: &Calibration,
    body_from_rectified: &Pose,
) -> Result<Camera, ImportError> {
    let name = format!("image_{number}");
    let folder = source.join(&name);
    let stamped = stamps.files(&folder, image_end(&folder)?.unwrap_or(".png"))?;
    let first = stamped.first().ok_or_else(|| ImportError::at(&folder, "has no images *.png or *.jpg"))?;
    let size = image_size(&first.path)?;
    let projection = calibration.projection(&format!("P{number}"))?;
    Ok(Camera {
        name,
        exposure_nanos: EXPOSURE_NANOS,
        body_from_camera: body_from_rectified * projection.rectified_from_camera,
        model: projection.model(size),
        n_absent: stamps.len() - stamped.len(),
        images: stamped.into_iter().map(|file| (file.stamp, file.path)).collect(),
    })
}

/// Adds the poses of the rectified camera 0 in its first frame. The world frame of the drive is the first body frame.
fn add_truth(plan: &mut Plan, path: &Path, stamps: &Stamps, body_from_camera: &Pose) -> Result<(), ImportError> {
    let poses = poses_from_kitti(&read_long_text(path).at(path)?).at(path)?;
    if poses.len() != stamps.len() {
        let rule = format!("{} poses, but {} has {} times", poses.len(), stamps.path().display(), stamps.len());
        return Err(ImportError::at(path, rule));
    }
    let mut trajectory = Trajectory::default();
    for (number, first_from_camera) in poses.iter().enumerate() {
        let pose = body_from_camera * first_from_camera * body_from_camera.inverse();
        if !trajectory.push(Stamp(stamps.by_number(number, path)?), pose) {
            return Err(ImportError::at(stamps.path(), format!("time {number} is earlier than the previous one")));
        }
    }
    plan.add_truth(&trajectory, None);
    plan.report.push(format!("imported: {} true poses of {}", poses.len(), path.display()));
    plan.read.push(path.to_owned());
    Ok(())
}

fn add_labels(plan: &mut Plan, folder: &Path, found: &KittiSweeps) -> Result<(), ImportError> {
    let Some(truth) = &mut plan.manifest.truth else {
        let rule = "the labels need poses: poses.txt here, or poses/<sequence>.txt next to the folder of the sequences";
        return Err(ImportError::at(folder, rule));
    };
    truth.labels = Some(LABELS.to_owned());
    let conversions = labels::conversions(Path::new(LABELS), folder, found)?;
    plan.report.push(format!("imported: {} label files, in the classes of this project", conversions.len()));
    plan.conversions.extend(conversions);
    Ok(())
}
