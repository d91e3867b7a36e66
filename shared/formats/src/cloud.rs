//! One point of a cloud file that knows no firing times: PCD, KITTI.

/// x y z and intensity as the file has them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudPoint {
    /// m.
    pub x: f32,
    /// m.
    pub y: f32,
    /// m.
    pub z: f32,
    /// 0 if the file has none.
    pub intensity: f32,
}
