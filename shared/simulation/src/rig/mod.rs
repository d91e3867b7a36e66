//! The vehicle as data: which sensors it carries, where they sit and how good they are.
//!
//! A rig file (`docs/simulation.md`) describes one; three are built in. The body frame is the vehicle's own, x forward, y left,
//! z up, `body_height_m` above the road.

mod calibration;
mod file;

pub use calibration::CalibrationError;

use crate::sensors::gnss::Receiver;
use crate::sensors::imu::Grade;
use crate::sensors::mosaic::MosaicModel;
use formats::problems::FileError;
use formats::velodyne::Model;
use geometry::{CameraModel, Pose};
use std::path::Path;

/// A vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct RigSpec {
    /// For people.
    pub name: String,
    /// Height of the body frame above the road, 0 to 3 m.
    pub body_height_m: f64,
    /// The LiDAR.
    pub lidar: LidarSpec,
    /// When all cameras fire.
    pub trigger: TriggerSpec,
    /// Color cameras by index.
    pub cameras: Vec<CameraSpec>,
    /// Mosaic cameras by index.
    pub mosaics: Vec<MosaicSpec>,
    /// The receiver, if there is one.
    pub gnss: Option<GnssSpec>,
    /// The inertial unit, if there is one.
    pub imu: Option<ImuSpec>,
}

/// A LiDAR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarSpec {
    /// Which one.
    pub model: Model,
    /// Mounting.
    pub body_from_lidar: Pose,
}

/// When the cameras fire: at a rate, and only if the vehicle has moved since.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerSpec {
    /// Exposures per second, 0.1 to 30.
    pub rate_hz: f64,
    /// Way since the last exposure, 0 to 100 m.
    pub way_m: f64,
}

/// A color camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSpec {
    /// For people.
    pub name: String,
    /// Exposure time, ns.
    pub exposure_nanos: u64,
    /// Mounting.
    pub body_from_camera: Pose,
    /// Lens and size of the image.
    pub lens: CameraModel,
}

/// A mosaic camera.
#[derive(Clone, Debug, PartialEq)]
pub struct MosaicSpec {
    /// Also the name of its folder.
    pub name: String,
    /// Which one.
    pub sensor: MosaicModel,
    /// Mounting.
    pub body_from_camera: Pose,
    /// Lens; the image has the sensor's size.
    pub lens: CameraModel,
}

/// A GNSS receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssSpec {
    /// How good it is.
    pub receiver: Receiver,
    /// Where its antenna is, m.
    pub antenna_in_body: [f64; 3],
}

/// An inertial unit whose axes are the body's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSpec {
    /// How good it is.
    pub grade: Grade,
    /// Samples per second, 10 to 1000.
    pub rate_hz: f64,
    /// Where acceleration is felt, m.
    pub position_in_body: [f64; 3],
}

/// Names and files of the built-in rigs, the default one first.
const BUILT_IN: [(&str, &str); 4] = [
    ("l3d2", include_str!("../../rigs/l3d2.toml")),
    ("survey", include_str!("../../rigs/survey.toml")),
    ("nuscenes", include_str!("../../rigs/nuscenes.toml")),
    ("kitti", include_str!("../../rigs/kitti.toml")),
];

impl RigSpec {
    /// The vehicle of the thesis.
    pub fn l3d2() -> Self {
        Self::built_in("l3d2").expect("a test reads all built-in rigs")
    }

    /// Names of the built-in rigs.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.into_iter().map(|(name, _)| name)
    }

    /// A built-in rig.
    pub fn built_in(name: &str) -> Option<Self> {
        let (name, text) = BUILT_IN.into_iter().find(|(known, _)| *known == name)?;
        Self::from_toml(Path::new(name), text).ok()
    }

    /// Indexes of color cameras with equal lenses: they are taken for one instrument, whose cameras share their gain.
    pub fn lens_groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (index, camera) in self.cameras.iter().enumerate() {
            match groups.iter_mut().find(|group| self.cameras[group[0]].lens == camera.lens) {
                Some(group) => group.push(index),
                None => groups.push(vec![index]),
            }
        }
        groups
    }

    /// Reads the text of a rig file; the path is for messages. The error has all faults at once.
    pub fn from_toml(path: &Path, text: &str) -> Result<Self, FileError> {
        file::read(path, text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vector3;

    #[test]
    fn all_built_in_rigs_read() {
        for (name, text) in BUILT_IN {
            match RigSpec::from_toml(Path::new(name), text) {
                Ok(rig) => assert_eq!(rig.name, name),
                Err(error) => panic!("{error}"),
            }
        }
        assert_eq!(RigSpec::built_in("unknown"), None);
    }

    #[test]
    fn the_lidar_axis_of_the_l3d2_rises_30_degrees_to_the_back() {
        let body_from_lidar = RigSpec::l3d2().lidar.body_from_lidar;
        let expected = Vector3::new(-30.0_f64.to_radians().cos(), 0.0, 0.5);
        assert!((body_from_lidar * Vector3::z() - expected).norm() < 1e-12);
        assert!((body_from_lidar * Vector3::y() - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn cameras_of_the_l3d2_look_where_they_should() {
        let rig = RigSpec::l3d2();
        assert_eq!((rig.cameras.len(), rig.mosaics.len()), (6, 2));
        for (k, camera) in rig.cameras.iter().take(5).enumerate() {
            let yaw = -72.0_f64.to_radians() * k as f64;
            let outward = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
            let pose = camera.body_from_camera;
            assert!((pose * Vector3::z() - outward).norm() < 1e-9);
            assert!((pose * Vector3::y() + Vector3::z()).norm() < 1e-9, "image rows run down");
            let from_head = pose.translation.vector - Vector3::new(-0.4, 0.0, 2.2);
            assert!((from_head - outward * 0.042).norm() < 2e-6, "{from_head}");
        }
        let up = rig.cameras[5].body_from_camera;
        assert!((up * Vector3::z() - Vector3::z()).norm() < 1e-9);
        assert!((up * Vector3::y() - Vector3::x()).norm() < 1e-9, "its image has the back at the top");
        for mosaic in &rig.mosaics {
            let pose = mosaic.body_from_camera;
            assert!((pose * Vector3::z() - Vector3::y()).norm() < 1e-9);
            assert!((pose * Vector3::x() - Vector3::x()).norm() < 1e-9, "forward is right of a look to the left");
        }
    }
}
