//! Points of cloud files without firing times: PCD, KITTI.

/// x, y, z and intensity as stored in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudPoint {
    /// x, m.
    pub x: f32,
    /// y, m.
    pub y: f32,
    /// z, m.
    pub z: f32,
    /// Intensity, 0 if the file has none.
    pub intensity: f32,
}
