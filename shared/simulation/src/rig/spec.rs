//! Specification of a vehicle and its sensors.

use crate::sensors::gnss::GnssSpec;
use crate::sensors::imu::ImuSpec;
use crate::sensors::mosaic::MosaicModel;
use crate::sensors::trigger::TriggerSpec;
use geometry::{CameraModel, Pose};
use lidar::velodyne::Model;

/// A vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct RigSpec {
    /// Display name.
    pub name: String,
    /// Height of the body frame above the road, 0 to 3 m.
    pub body_height_m: f64,
    /// The first LiDAR.
    pub lidar: LidarSpec,
    /// Name of the first LiDAR, if there are several.
    pub lidar_name: Option<String>,
    /// The other LiDARs.
    pub other_lidars: Vec<OtherLidarSpec>,
    /// Trigger of all cameras.
    pub trigger: TriggerSpec,
    /// Color cameras by index.
    pub cameras: Vec<CameraSpec>,
    /// Mosaic cameras by index.
    pub mosaics: Vec<MosaicSpec>,
    /// GNSS receiver, if any.
    pub gnss: Option<GnssSpec>,
    /// Inertial unit, if any.
    pub imu: Option<ImuSpec>,
}

/// A LiDAR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarSpec {
    /// Model.
    pub model: Model,
    /// Mounting.
    pub body_from_lidar: Pose,
}

/// An additional LiDAR.
#[derive(Clone, Debug, PartialEq)]
pub struct OtherLidarSpec {
    /// Name, which is also its folder in the drive.
    pub name: String,
    /// Model and mounting.
    pub lidar: LidarSpec,
}

/// A color camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSpec {
    /// Display name.
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
    /// Name, which is also its folder in the drive.
    pub name: String,
    /// Model.
    pub sensor: MosaicModel,
    /// Mounting.
    pub body_from_camera: Pose,
    /// Lens; the image has the size of the sensor.
    pub lens: CameraModel,
}

impl RigSpec {
    /// Indices of color cameras with equal lenses: such cameras form one instrument and share their gain.
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
}
