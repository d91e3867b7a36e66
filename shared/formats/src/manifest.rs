//! `drive.toml`: what a drive folder holds and how its sensors are mounted (`docs/drive.md`).

mod calibration;
pub mod rules;

pub use calibration::{Calibration, MountingEntry};

use geometry::{CameraModel, Isometry3, Pose, Quaternion, Rig, RigCamera, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// The version that this crate writes.
pub(crate) const MANIFEST_VERSION: u32 = 1;

/// The whole file. Paths are relative to the drive folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Of the format; [`Manifest::of_lidar`] writes the current one.
    pub version: u32,
    /// For people.
    pub name: String,
    /// The LiDAR.
    pub lidar: LidarEntry,
    /// Color cameras by index.
    #[serde(default, rename = "camera")]
    pub cameras: Vec<CameraEntry>,
    /// Mosaic cameras by index.
    #[serde(default, rename = "mosaic")]
    pub mosaics: Vec<MosaicEntry>,
    /// Position fixes.
    pub gnss: Option<GnssEntry>,
    /// Inertial samples.
    pub imu: Option<ImuEntry>,
    /// Ground truth, of simulated and annotated drives.
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

/// The LiDAR's recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LidarEntry {
    /// `hdl32e`, `vlp16` or `hdl64e`.
    pub model: String,
    /// `pcap`: packet captures. `pcd` or `bin`: one file per sweep, 10 sweeps per second unless `times.txt` in the folder
    /// says otherwise.
    pub format: String,
    /// Folder of the files; they are read in the order of their names.
    pub folder: String,
    /// Mounting.
    pub body_from_lidar: PoseEntry,
}

/// A color camera's recording: `<folder>/<stamp in ns>.jpg` or `.png`, the stamp is the middle of the exposure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraEntry {
    /// For people.
    pub name: String,
    /// Folder of the images.
    pub folder: String,
    /// Exposure time, ns.
    pub exposure_nanos: u64,
    /// Mounting.
    pub body_from_camera: PoseEntry,
    /// Lens.
    pub model: CameraModel,
}

/// A mosaic camera's recording: `<folder>/<stamp in ns>.pgm` (16 bit), `<folder>/dark/*.pgm`, `<folder>/white/*.pgm`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MosaicEntry {
    /// `hs02` or `hs03`, for people.
    pub name: String,
    /// Folder of the raw images.
    pub folder: String,
    /// The maker's calibration file ([`crate::sensor_calibration`]); it must agree with what stands here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// Exposure time, ns.
    pub exposure_nanos: u64,
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
    /// What the white reference shows, if not a target of `white_reflectance` all over the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub white_panel: Option<WhitePanelEntry>,
    /// Mounting.
    pub body_from_camera: PoseEntry,
    /// Lens, for the raw image.
    pub model: CameraModel,
}

/// A white panel in a part of the image, or with a reflectance for each band.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhitePanelEntry {
    /// One for each cell of the pattern, row by row, above 0 up to 1; else `white_reflectance` holds for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflectances: Option<Vec<f64>>,
    /// Left column, top row, width and height of the panel in the white frames, px; inside the active area.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<[u32; 4]>,
}

/// NMEA sentences.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssEntry {
    /// The log.
    pub file: String,
    /// Latitude (deg), longitude (deg) and height (m) of the world frame's origin, WGS84.
    pub origin: [f64; 3],
    /// Position of the antenna in the body frame, m.
    pub antenna_in_body: [f64; 3],
}

/// Inertial samples: CSV with the header `stamp,ax,ay,az,wx,wy,wz` (ns, m/s^2, rad/s).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuEntry {
    /// The log.
    pub file: String,
    /// Where acceleration is felt, in the body frame, m. The axes are the body's.
    #[serde(default)]
    pub position_in_body: [f64; 3],
}

/// What is known to be true.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruthEntry {
    /// `world_from_body` in TUM format, one line every 10 ms.
    pub trajectory: String,
    /// Folder with one file per sweep, `<seq, 6 digits>.label`, as SemanticKITTI: u32 per return in the order of firing,
    /// low 16 bits class, high 16 bits instance.
    pub labels: String,
    /// True mountings ([`Calibration`]); those of this manifest are what the vehicle's maker measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// What the receiver went through: CSV, one line per second with the satellites in sight and the error of the fix.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gnss: Option<String>,
}

impl PoseEntry {
    /// The identity.
    pub const IDENTITY: Self = Self { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };

    /// `None` unless finite and the quaternion's norm is 1 within 1e-3; it is normalized.
    pub fn to_pose(&self) -> Option<Pose> {
        let [x, y, z, w] = self.rotation;
        let quaternion = Quaternion::new(w, x, y, z);
        let sound = self.translation.iter().all(|v| v.is_finite()) && (quaternion.norm() - 1.0).abs() < 1e-3;
        sound.then(|| {
            Isometry3::from_parts(Translation3::from(self.translation), UnitQuaternion::from_quaternion(quaternion))
        })
    }
}

impl From<Pose> for PoseEntry {
    fn from(pose: Pose) -> Self {
        let q = pose.rotation.coords;
        Self { translation: pose.translation.vector.into(), rotation: [q.x, q.y, q.z, q.w] }
    }
}

impl Manifest {
    /// Of a drive that has a LiDAR alone.
    pub fn of_lidar(name: &str, lidar: LidarEntry) -> Self {
        Self {
            version: MANIFEST_VERSION,
            name: name.to_owned(),
            lidar,
            cameras: Vec::new(),
            mosaics: Vec::new(),
            gnss: None,
            imu: None,
            truth: None,
        }
    }
    /// The mounting of all sensors. The error names the entry whose pose is no rigid transform.
    pub fn rig(&self) -> Result<Rig, String> {
        let pose = |name: &str, entry: &PoseEntry| {
            entry
                .to_pose()
                .ok_or_else(|| format!("{name}: {entry:?} is no rigid transform (finite, unit quaternion x y z w)"))
        };
        let camera = |name: &str, entry: &PoseEntry, model: &CameraModel| {
            Ok::<_, String>(RigCamera { body_from_camera: pose(name, entry)?, model: model.clone() })
        };
        Ok(Rig {
            body_from_lidar: pose("lidar.body_from_lidar", &self.lidar.body_from_lidar)?,
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
