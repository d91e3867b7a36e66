//! An object in the clouds of a run.

use geometry::OrientedRectangle;

/// What is printed about one object.
pub struct ObjectSummary {
    pub id: i64,
    pub class: &'static str,
    pub n_points: u64,
    pub n_clouds: u64,
    /// In the frame of the clouds.
    pub footprint: OrientedRectangle,
    /// Heights of the lowest and the highest point, m.
    pub z: (f64, f64),
}
