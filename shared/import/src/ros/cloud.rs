//! `sensor_msgs/PointCloud2` and Livox `CustomMsg`: points of any layout.

mod fields;
mod livox;

pub(crate) use fields::Fields;
pub(crate) use livox::livox_points;

/// A point as stored in the message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RawPoint {
    pub position: [f64; 3],
    pub intensity: f32,
    /// Number of the beam as counted by the driver.
    pub ring: Option<u16>,
    /// Time in the unit of the driver.
    pub time: Option<f64>,
}
