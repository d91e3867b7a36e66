//! `sensor_msgs/PointCloud2` and Livox `CustomMsg`: points of any layout.

mod fields;
mod livox;

pub(crate) use fields::Fields;
pub(crate) use livox::livox_points;

/// A point as the message has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RawPoint {
    pub position: [f32; 3],
    pub intensity: f32,
    /// Number of the beam in the count of the driver.
    pub ring: Option<u16>,
    /// In the unit of the driver.
    pub time: Option<f64>,
}
