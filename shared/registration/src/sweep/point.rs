//! A return of a sweep.

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedPoint {
    /// x y z, m, LiDAR frame at the time of the shot.
    pub position: [f32; 3],
    /// ns after the sweep's stamp.
    pub offset_nanos: u32,
    /// Beam, 0 = lowest.
    pub ring: u8,
}
