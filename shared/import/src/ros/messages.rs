//! Messages of ROS, limited to the imported parts.

use super::cursor::{Cursor, MessageFault};
use lidar::nmea::StatedDeviation;

type Result<T> = std::result::Result<T, MessageFault>;

/// `std_msgs/Header`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    /// ns since the Unix epoch; 0 if it was not set.
    pub stamp: i64,
    /// Frame without the leading slash of ROS 1.
    pub frame: String,
}

impl Header {
    pub fn read(c: &mut Cursor<'_>) -> Result<Self> {
        if c.is_ros1() {
            c.u32("header.seq")?;
        }
        let stamp = c.time("header.stamp")?;
        Ok(Self { stamp, frame: frame(c, "header.frame_id")? })
    }
}

fn frame(c: &mut Cursor<'_>, field: &'static str) -> Result<String> {
    let name = c.text(field)?;
    Ok(name.strip_prefix('/').unwrap_or(&name).to_owned())
}

/// `sensor_msgs/Imu` without covariances.
pub(crate) struct Imu {
    pub header: Header,
    pub angular_rate: [f64; 3],
    pub acceleration: [f64; 3],
    /// Whether the message states that it has both.
    pub is_complete: bool,
}

impl Imu {
    pub fn read(c: &mut Cursor<'_>) -> Result<Self> {
        let header = Header::read(c)?;
        c.f64s::<4>("orientation")?;
        c.f64s::<9>("orientation_covariance")?;
        let angular_rate = c.f64s("angular_velocity")?;
        let [no_rate, ..] = c.f64s::<9>("angular_velocity_covariance")?;
        let acceleration = c.f64s("linear_acceleration")?;
        let [no_acceleration, ..] = c.f64s::<9>("linear_acceleration_covariance")?;
        // -1 means that there is no value.
        Ok(Self { header, angular_rate, acceleration, is_complete: no_rate != -1.0 && no_acceleration != -1.0 })
    }
}

/// `sensor_msgs/NavSatFix`.
pub(crate) struct NavSatFix {
    pub header: Header,
    /// -1 none, 0 GNSS alone, 1 with corrections from satellites, 2 with corrections from the ground.
    pub status: i8,
    /// Latitude, longitude.
    pub position_deg: [f64; 2],
    /// Height above the ellipsoid, m; NaN if unknown.
    pub altitude_m: f64,
    /// Standard deviations, if the covariance is known.
    pub deviation: Option<StatedDeviation>,
}

impl NavSatFix {
    pub fn read(c: &mut Cursor<'_>) -> Result<Self> {
        let header = Header::read(c)?;
        let status = c.u8("status.status")? as i8;
        c.u16("status.service")?;
        let position_deg = c.f64s("latitude and longitude")?;
        let altitude_m = c.f64("altitude")?;
        let covariance: [f64; 9] = c.f64s("position_covariance")?;
        let is_known = c.u8("position_covariance_type")? != 0;
        let across_m = f64::midpoint(covariance[0], covariance[4]).sqrt();
        let up_m = covariance[8].sqrt();
        let is_valid = is_known && [across_m, up_m].iter().all(|m| m.is_finite() && *m > 0.0);
        let deviation = is_valid.then_some(StatedDeviation { across_m, up_m });
        Ok(Self { header, status, position_deg, altitude_m, deviation })
    }
}

/// `sensor_msgs/Image`.
pub(crate) struct Image<'a> {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub encoding: String,
    /// Byte order of values of more than 8 bits.
    pub is_big: bool,
    /// Bytes of a row.
    pub step: u32,
    pub data: &'a [u8],
}

impl<'a> Image<'a> {
    pub fn read(c: &mut Cursor<'a>) -> Result<Self> {
        let header = Header::read(c)?;
        let height = c.u32("height")?;
        let width = c.u32("width")?;
        let encoding = c.text("encoding")?;
        let is_big = c.u8("is_bigendian")? != 0;
        Ok(Self { header, height, width, encoding, is_big, step: c.u32("step")?, data: c.blob("data")? })
    }
}

/// `sensor_msgs/CompressedImage`.
pub(crate) struct CompressedImage<'a> {
    pub header: Header,
    pub format: String,
    pub data: &'a [u8],
}

impl<'a> CompressedImage<'a> {
    pub fn read(c: &mut Cursor<'a>) -> Result<Self> {
        Ok(Self { header: Header::read(c)?, format: c.text("format")?, data: c.blob("data")? })
    }
}

/// `sensor_msgs/CameraInfo`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraInfo {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub distortion_model: String,
    pub distortion: Vec<f64>,
    /// 3 x 3, row by row.
    pub intrinsics: [f64; 9],
    /// 3 x 3, row by row; rotates the raw camera to the rectified one.
    pub rectification: [f64; 9],
    /// 3 x 4, row by row; projection of the rectified image.
    pub projection: [f64; 12],
    pub binning: [u32; 2],
    /// x, y, height, width; all 0 for the whole image.
    pub region: [u32; 4],
}

impl CameraInfo {
    pub fn read(c: &mut Cursor<'_>) -> Result<Self> {
        let header = Header::read(c)?;
        let height = c.u32("height")?;
        let width = c.u32("width")?;
        let distortion_model = c.text("distortion_model")?;
        let n = c.length("d", size_of::<f64>())?;
        let distortion = (0..n).map(|_| c.f64("d")).collect::<Result<_>>()?;
        let intrinsics = c.f64s("k")?;
        let rectification = c.f64s("r")?;
        let projection = c.f64s("p")?;
        let binning = [c.u32("binning_x")?, c.u32("binning_y")?];
        let mut region = [0; 4];
        for value in &mut region {
            *value = c.u32("roi")?;
        }
        Ok(Self {
            header,
            height,
            width,
            distortion_model,
            distortion,
            intrinsics,
            rectification,
            projection,
            binning,
            region,
        })
    }
}

/// `geometry_msgs/TransformStamped`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Transform {
    pub parent: String,
    pub child: String,
    pub translation: [f64; 3],
    /// x y z w.
    pub rotation: [f64; 4],
}

/// `tf2_msgs/TFMessage`.
pub(crate) fn transforms(c: &mut Cursor<'_>) -> Result<Vec<Transform>> {
    // Seven numbers, a time and two texts.
    let n = c.length("transforms", 7 * size_of::<f64>() + 16)?;
    let one = |c: &mut Cursor<'_>| {
        let parent = Header::read(c)?.frame;
        let child = frame(c, "child_frame_id")?;
        Ok(Transform { parent, child, translation: c.f64s("translation")?, rotation: c.f64s("rotation")? })
    };
    (0..n).map(|_| one(c)).collect()
}

/// `nmea_msgs/Sentence`.
pub(crate) fn sentence(c: &mut Cursor<'_>) -> Result<String> {
    Header::read(c)?;
    c.text("sentence")
}

/// `std_msgs/String`.
pub(crate) fn string(c: &mut Cursor<'_>) -> Result<String> {
    c.text("data")
}
