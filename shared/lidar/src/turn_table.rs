//! Sine and cosine by encoder count.

use super::TURN;
use std::sync::LazyLock;

/// The table, shared by all decoders: computing it is by far the most work of a new decoder.
static SIN_COS: LazyLock<Vec<[f32; 2]>> = LazyLock::new(|| {
    let angle = |count: u16| (f64::from(count) * 0.01).to_radians().sin_cos();
    (0..TURN).map(angle).map(|(sin, cos)| [sin as f32, cos as f32]).collect()
});

/// Sine and cosine of all encoder counts.
#[derive(Clone, Debug)]
pub(crate) struct TurnTable(&'static [[f32; 2]]);

impl TurnTable {
    pub(crate) fn new() -> Self {
        Self(&SIN_COS)
    }

    /// Sine and cosine of a count from 0 to 35999.
    #[inline(always)]
    pub(crate) fn sin_cos(&self, count: u16) -> [f32; 2] {
        self.0[usize::from(count)]
    }
}

/// The azimuth of a point, clockwise from +x, 0.01 deg, 0 to 35999.
#[inline]
pub(crate) fn azimuth_of(x: f32, y: f32) -> u16 {
    ((-y.atan2(x).to_degrees() * 100.0).round() as i32).rem_euclid(i32::from(TURN)) as u16
}
