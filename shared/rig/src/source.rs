//! Third-party calibrations as sources of a rig.

mod kalibr;
mod kitti;
mod ladybug;
mod lens;
mod nuscenes;
mod opencv;
mod tf;

pub use tf::FrameTree;

use crate::error::RigError;
use crate::yaml::{Node, YamlError, documents};
use drive::manifest::{CameraEntry, GnssEntry, ImuEntry, LidarEntry, Manifest, PoseEntry};
use geometry::{CameraModel, Pose, Quaternion, UnitQuaternion};
use std::path::Path;

/// Size limit of a calibration text, bytes. The calibrations of all logs of nuScenes are 5 MB.
const MAX_BYTES: u64 = 64 << 20;
/// Exposure time of entries whose source has no exposure time, ns.
pub const UNKNOWN_EXPOSURE_NANOS: u64 = 2_000_000;

/// Choices for sources that are ambiguous.
#[derive(Clone, Debug, Default)]
pub struct SourceOptions {
    /// Pose of the source frame in the body; `None`: the source states it, or the frames are the same.
    pub body_from_source: Option<Pose>,
    /// Name of the body frame in a tf tree.
    pub body_frame: Option<String>,
    /// Columns and rows of images, for sources without them, px.
    pub image_size: Option<[u32; 2]>,
    /// nuScenes: name of the log.
    pub log: Option<String>,
    /// Name of a camera whose file does not name it.
    pub camera_name: Option<String>,
}

/// A camera of a source.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPart {
    /// Its name.
    pub name: String,
    /// Name of its frame in a tf tree, if the source names one.
    pub frame: Option<String>,
    /// Mounting; `None` if the source does not have it.
    pub body_from_camera: Option<Pose>,
    /// Lens.
    pub model: CameraModel,
}

/// The parts of a rig that a source contains.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigParts {
    /// Mounting of the LiDAR.
    pub body_from_lidar: Option<Pose>,
    /// Cameras.
    pub cameras: Vec<CameraPart>,
    /// Mounting of the inertial unit.
    pub body_from_imu: Option<Pose>,
    /// Antenna of the receiver, body frame, m.
    pub antenna_in_body: Option<[f64; 3]>,
    /// Notes on used, assumed and skipped parts.
    pub notes: Vec<String>,
}

/// Reads a source. Its kind is recognized from its name and content. `tree` has the frames of a tf file that was read
/// before.
pub fn read(path: &Path, options: &SourceOptions, tree: &mut FrameTree) -> Result<RigParts, RigError> {
    if path.is_dir() {
        return kitti::read(path, options);
    }
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "cal" => ladybug::read(path, &text(path)?, options),
        "json" => nuscenes::read(path, options),
        "yaml" | "yml" => {
            let text = text(path)?;
            let all = documents(&text).map_err(|fault| yaml_error(path, &fault))?;
            parts_from_documents(path, &all, options, tree)
        }
        _ => Err(RigError::source(
            path,
            "",
            "not a known calibration; must be a folder of KITTI, a .json of nuScenes, a .cal of a Ladybug, or a .yaml (tf tree, Kalibr, \
             OpenCV, camera_info)",
        )),
    }
}

fn parts_from_documents(
    path: &Path,
    all: &[Node],
    options: &SourceOptions,
    tree: &mut FrameTree,
) -> Result<RigParts, RigError> {
    let fault = |fault: YamlError| yaml_error(path, &fault);
    let first = all.first().ok_or_else(|| RigError::source(path, "", "is empty"))?;
    if first.get("transforms").is_some() || first.get("child_frame_id").is_some() {
        tree.add(all).map_err(fault)?;
        return tree.parts(options).map_err(|rule| RigError::source(path, "", rule));
    }
    if first.entries().iter().any(|(key, _)| key == "cam0") {
        return kalibr::parts(first, options).map_err(fault);
    }
    if first.get_any(opencv::MATRIX_KEYS).is_some() {
        return opencv::parts(first, path, options).map_err(fault);
    }
    let keys: Vec<&str> = first.entries().iter().take(5).map(|(key, _)| key.as_str()).collect();
    let rule = format!(
        "not a known calibration: its keys are {}; must have transforms (tf), cam0 (Kalibr), or camera_matrix or K (OpenCV, \
         camera_info)",
        if keys.is_empty() { "none".to_owned() } else { keys.join(", ") }
    );
    Err(RigError::source(path, "", rule))
}

/// The text of a file.
fn text(path: &Path) -> Result<String, RigError> {
    let size = path.metadata().map_err(|error| RigError::io(path, error))?.len();
    if size > MAX_BYTES {
        return Err(RigError::source(path, "", format!("{size} bytes; must be at most {MAX_BYTES}")));
    }
    files::text_file::read_long_text(path).map_err(|error| RigError::io(path, error))
}

fn yaml_error(path: &Path, fault: &YamlError) -> RigError {
    RigError::source(path, &format!("line {}", fault.line), fault.rule.clone())
}

/// The pose from a 4 x 4 or 3 x 4 matrix, row by row.
fn pose_of_matrix(numbers: &[f64]) -> Result<Pose, String> {
    if numbers.len() != 12 && numbers.len() != 16 {
        return Err(format!("{} numbers; a transform has 12 or 16", numbers.len()));
    }
    if numbers.len() == 16 && numbers[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("last row {:?}; must be 0, 0, 0, 1", &numbers[12..]));
    }
    let matrix = nalgebra::Matrix3::from_fn(|row, column| numbers[4 * row + column]);
    let rotation = crate::rotation::from_matrix(&matrix).map_err(|error| error.to_string())?;
    Ok(Pose::from_parts(geometry::Translation3::new(numbers[3], numbers[7], numbers[11]), rotation))
}

/// The pose from a position and a quaternion x y z w.
fn pose_of(position: [f64; 3], [x, y, z, w]: [f64; 4]) -> Result<Pose, String> {
    crate::rotation::from_quaternion([x, y, z, w]).map_err(|error| error.to_string())?;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Ok(Pose::from_parts(position.into(), rotation))
}

impl RigParts {
    /// Adds the parts of another source. The later source has priority.
    pub fn merge(&mut self, other: Self) {
        self.body_from_lidar = other.body_from_lidar.or(self.body_from_lidar);
        self.body_from_imu = other.body_from_imu.or(self.body_from_imu);
        self.antenna_in_body = other.antenna_in_body.or(self.antenna_in_body);
        self.cameras.extend(other.cameras);
        self.notes.extend(other.notes);
    }

    /// Mounts cameras that name their frame, using the tree.
    pub fn mount(&mut self, tree: &FrameTree, options: &SourceOptions) -> Result<(), String> {
        for camera in self.cameras.iter_mut().filter(|camera| camera.body_from_camera.is_none()) {
            if let Some(frame) = camera.frame.as_ref().filter(|frame| tree.has(frame)) {
                camera.body_from_camera = Some(tree.body_from(frame, options)?);
                self.notes.push(format!("camera {}: mounting of tf frame {frame}", camera.name));
            }
        }
        Ok(())
    }

    /// The `drive.toml`, with the file paths of the drive folder.
    pub fn manifest(&self, name: &str, lidar: LidarEntry, origin: Option<[f64; 3]>) -> Result<Manifest, String> {
        let mut manifest = Manifest::with_lidar(name, lidar);
        for (index, camera) in self.cameras.iter().enumerate() {
            let pose = camera.body_from_camera.ok_or_else(|| {
                format!(
                    "camera {}: no source has its mounting; give --position and --rotation of the frame of its file, or a tf tree with \
                     its frame",
                    camera.name
                )
            })?;
            manifest.cameras.push(CameraEntry {
                delay_nanos: 0,
                name: camera.name.clone(),
                folder: format!("camera/{index}"),
                exposure_nanos: UNKNOWN_EXPOSURE_NANOS,
                body_from_camera: pose.into(),
                model: camera.model.clone(),
            });
        }
        manifest.imu = self.body_from_imu.map(|pose| ImuEntry {
            delay_nanos: 0,
            file: "imu.csv".to_owned(),
            position_in_body: [0.0; 3],
            body_from_imu: Some(PoseEntry::from(pose)),
        });
        if let (Some(antenna_in_body), Some(origin)) = (self.antenna_in_body, origin) {
            manifest.gnss = Some(GnssEntry {
                delay_nanos: 0,
                file: "gnss.nmea".to_owned(),
                origin,
                antenna_in_body,
                geoid_m: None,
            });
        }
        Ok(manifest)
    }
}
