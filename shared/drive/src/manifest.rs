//! `drive.toml`: contents of a drive folder and mounting of its sensors (`docs/reference/drive_folder.md`).

mod calibration;
mod lidars;
pub mod rules;
mod trajectory;

pub use calibration::{Calibration, LidarMountingEntry, MountingEntry};
pub use lidars::LidarEntry;
pub use trajectory::{Clock, HeadingSense, TrajectoryEntry, TrajectoryFormat};

use geometry::{CameraModel, Isometry3, Pose, Quaternion, Rig, RigCamera, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Version of the format that this crate reads and writes.
pub(crate) const MANIFEST_VERSION: u32 = 1;

/// Content of the file. Paths are relative to the drive folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "lidars::ManifestFile", into = "lidars::ManifestFile")]
pub struct Manifest {
    /// Version of the format.
    pub version: u32,
    /// Name of the drive, used only for display.
    pub name: String,
    /// The first LiDAR, whose revolutions are the ticks of the drive.
    pub lidar: LidarEntry,
    /// The other LiDARs; in the file, all are tables `[[lidar]]`.
    pub other_lidars: Vec<LidarEntry>,
    /// Color cameras.
    pub cameras: Vec<CameraEntry>,
    /// Mosaic cameras.
    pub mosaics: Vec<MosaicEntry>,
    /// GNSS receiver.
    pub gnss: Option<GnssEntry>,
    /// IMU.
    pub imu: Option<ImuEntry>,
    /// Post-processed trajectory.
    pub trajectory: Option<TrajectoryEntry>,
    /// Ground truth of simulated and annotated drives.
    pub truth: Option<TruthEntry>,
}

/// A rigid transform: m and unit quaternion x y z w.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseEntry {
    /// x y z, m.
    pub translation: [f64; 3],
    /// x y z w.
    pub rotation: [f64; 4],
}

/// A color camera's recording: `<folder>/<stamp in ns>.jpg` or `.png`. The stamp is the middle of the exposure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraEntry {
    /// Name of the camera, used only for display.
    pub name: String,
    /// Folder of the images.
    pub folder: String,
    /// Exposure time, ns.
    pub exposure_nanos: u64,
    /// Delay of the stamps relative to the measurement, ns. Subtracted from all stamps.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub delay_nanos: i64,
    /// Mounting.
    pub body_from_camera: PoseEntry,
    /// Lens.
    pub model: CameraModel,
}

/// A mosaic camera's recording: `<folder>/<stamp in ns>.pgm` (16 bit), `<folder>/dark/*.pgm`, `<folder>/white/*.pgm`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MosaicEntry {
    /// Name of the camera, for example `hs02`, used only for display.
    pub name: String,
    /// Folder of the raw images.
    pub folder: String,
    /// Calibration file of the manufacturer ([`formats::sensor_calibration`]). It must agree with the values in this file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// Exposure time, ns.
    pub exposure_nanos: u64,
    /// Delay of the stamps relative to the measurement, ns. Subtracted from all stamps.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub delay_nanos: i64,
    /// Exposure time of the dark reference, ns.
    pub dark_exposure_nanos: u64,
    /// Exposure time of the white reference, ns.
    pub white_exposure_nanos: u64,
    /// Reflectance of the white target, 0 to 1.
    pub white_reflectance: f64,
    /// Significant bits of a sample.
    pub bit_depth: u32,
    /// Side of the filter pattern, px.
    pub pattern: u32,
    /// Left column, top row, width and height of the active area, px.
    pub active_area: [u32; 4],
    /// Center of each band, nm, row-major in the pattern.
    pub wavelengths_nm: Vec<f64>,
    /// Region and reflectances of the white reference. Without this entry the target covers the image and has `white_reflectance`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub white_panel: Option<WhitePanelEntry>,
    /// Mounting.
    pub body_from_camera: PoseEntry,
    /// Lens model of the raw image.
    pub model: CameraModel,
}

/// A white panel that covers a part of the image, or has a reflectance for each band.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhitePanelEntry {
    /// Reflectance for each cell of the pattern, row by row, above 0 up to 1. Without this entry, all cells have
    /// `white_reflectance`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflectances: Option<Vec<f64>>,
    /// Left column, top row, width and height of the panel in the white frames, px; inside the active area.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<[u32; 4]>,
}

/// A log of NMEA sentences.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssEntry {
    /// Name of the log file.
    pub file: String,
    /// Latitude (deg), longitude (deg) and height (m) of the world frame's origin, WGS84.
    pub origin: [f64; 3],
    /// Delay of the stamps relative to the measurement, ns. Subtracted from all stamps.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub delay_nanos: i64,
    /// Position of the antenna in the body frame, m.
    pub antenna_in_body: [f64; 3],
    /// Height of the geoid above the ellipsoid, m, for GGA sentences without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geoid_m: Option<f64>,
}

/// IMU samples: CSV with the header `stamp,ax,ay,az,wx,wy,wz` (ns, m/s^2, rad/s).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuEntry {
    /// Name of the log file.
    pub file: String,
    /// Delay of the stamps relative to the measurement, ns. Subtracted from all stamps.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub delay_nanos: i64,
    /// Position of the accelerometer in the body frame, m. Its axes are the axes of the body frame, unless
    /// `body_from_imu` is set.
    #[serde(default)]
    pub position_in_body: [f64; 3],
    /// Mounting of a unit with other axes, instead of `position_in_body`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_from_imu: Option<PoseEntry>,
}

/// Ground truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruthEntry {
    /// `world_from_body` in TUM format; simulated drives have a line every 10 ms.
    pub trajectory: String,
    /// Folder with one SemanticKITTI file per sweep, `<seq, 6 digits>.label`: a u32 per return in firing order, low 16 bits class,
    /// high 16 bits instance. Sweeps without a file have no labels.
    /// Optional: a trajectory alone is also ground truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// File with the true mountings ([`Calibration`]). The mountings in the manifest include measurement errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// CSV with the satellites in view and the error of the fix, one line per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gnss: Option<String>,
}

/// Whether a value is the default, which is not written.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde defines the signature")]
fn is_zero(value: &i64) -> bool {
    *value == 0
}

impl PoseEntry {
    /// The identity.
    pub const IDENTITY: Self = Self { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };

    /// The transform, with a normalized quaternion. `None` unless all numbers are finite and the norm is 1 within 1e-3.
    pub fn to_pose(&self) -> Option<Pose> {
        let [x, y, z, w] = self.rotation;
        let quaternion = Quaternion::new(w, x, y, z);
        let is_rigid = self.translation.iter().all(|v| v.is_finite()) && (quaternion.norm() - 1.0).abs() < 1e-3;
        is_rigid.then(|| {
            Isometry3::from_parts(Translation3::from(self.translation), UnitQuaternion::from_quaternion(quaternion))
        })
    }
}

impl ImuEntry {
    /// Mounting of the unit, which [`crate::Drive`] has checked.
    pub fn mounting(&self) -> Pose {
        let [x, y, z] = self.position_in_body;
        let position = || Isometry3::translation(x, y, z);
        self.body_from_imu.as_ref().and_then(PoseEntry::to_pose).unwrap_or_else(position)
    }
}

impl From<Pose> for PoseEntry {
    fn from(pose: Pose) -> Self {
        let q = pose.rotation.coords;
        Self { translation: pose.translation.vector.into(), rotation: [q.x, q.y, q.z, q.w] }
    }
}

/// Error of a manifest entry whose pose is not a rigid transform.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{entry}: {pose:?} is not a rigid transform; expected finite numbers and a unit quaternion x y z w")]
pub struct RigError {
    /// Name of the sensor.
    pub entry: String,
    /// The pose found.
    pub pose: PoseEntry,
}

impl Manifest {
    /// The manifest of a drive with only a LiDAR.
    pub fn with_lidar(name: &str, lidar: LidarEntry) -> Self {
        Self {
            version: MANIFEST_VERSION,
            name: name.to_owned(),
            lidar,
            other_lidars: Vec::new(),
            cameras: Vec::new(),
            mosaics: Vec::new(),
            gnss: None,
            imu: None,
            trajectory: None,
            truth: None,
        }
    }
    /// Mounting of all sensors.
    pub fn rig(&self) -> Result<Rig, RigError> {
        let pose = |name: &str, pose: &PoseEntry| {
            pose.to_pose().ok_or_else(|| RigError { entry: name.to_owned(), pose: *pose })
        };
        let camera = |name: &str, entry: &PoseEntry, model: &CameraModel| {
            Ok(RigCamera { body_from_camera: pose(name, entry)?, model: model.clone() })
        };
        Ok(Rig {
            body_from_lidar: pose("lidar.body_from_lidar", &self.lidar.body_from_lidar)?,
            body_from_other_lidars: (1..)
                .zip(&self.other_lidars)
                .map(|(index, entry)| pose(&format!("lidar[{index}].body_from_lidar"), &entry.body_from_lidar))
                .collect::<Result<_, _>>()?,
            cameras: self
                .cameras
                .iter()
                .map(|entry| camera(&entry.name, &entry.body_from_camera, &entry.model))
                .collect::<Result<_, _>>()?,
            mosaics: self
                .mosaics
                .iter()
                .map(|entry| camera(&entry.name, &entry.body_from_camera, &entry.model))
                .collect::<Result<_, _>>()?,
        })
    }
}
