//! Pinhole lens with Brown-Conrady distortion.

use super::NOWHERE;
use geometry::Pinhole;

/// Points nearer than this are inside the lens, m.
const MIN_DEPTH_M: f32 = 1e-3;

/// [`Pinhole`], prepared.
#[derive(Clone, Debug)]
pub struct PinholeLens {
    focal: [f32; 2],
    center: [f32; 2],
    distortion: [f32; 5],
    /// Squared tangent of the angle beyond which the distortion is not monotone.
    max_r2: f32,
}

impl From<&Pinhole> for PinholeLens {
    fn from(model: &Pinhole) -> Self {
        Self {
            focal: [model.fx as f32, model.fy as f32],
            center: [model.cx as f32, model.cy as f32],
            distortion: model.distortion.map(|k| k as f32),
            max_r2: largest_monotone_r2(model) as f32,
        }
    }
}

/// Squared tangent up to which the distortion is monotone, by bisection; at most 89.4 degrees from the axis.
fn largest_monotone_r2(model: &Pinhole) -> f64 {
    let mut low = 0.0;
    let mut high = 1e4;
    if model.is_monotone_to(high) {
        return high;
    }
    // 60 halvings reach the last bit.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if model.is_monotone_to(middle) { low = middle } else { high = middle }
    }
    low
}

impl PinholeLens {
    /// See [`super::Lens::widest_slope`].
    pub fn widest_slope(&self) -> f64 {
        f64::from(self.max_r2).sqrt()
    }

    /// See [`super::Lens::px_per_rad`].
    #[inline]
    pub fn px_per_rad(&self) -> f32 {
        self.focal[0]
    }

    /// See [`super::Lens::pixel`].
    #[inline(always)]
    pub fn pixel(&self, [x, y, z]: [f32; 3]) -> [f32; 2] {
        let is_ahead = z > MIN_DEPTH_M;
        let inverse = 1.0 / z;
        let x = x * inverse;
        let y = y * inverse;
        let r2 = x * x + y * y;
        let [k1, k2, p1, p2, k3] = self.distortion;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        // False for NaN.
        let is_in_view = is_ahead & (r2 <= self.max_r2);
        let pixel = [self.focal[0] * xd + self.center[0], self.focal[1] * yd + self.center[1]];
        if is_in_view { pixel } else { NOWHERE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_beyond_monotone_distortion_are_not_visible() {
        let width = 1600;
        let height = 900;
        let fx = 1266.4;
        let fy = 1260.0;
        let cx = 816.3;
        let cy = 491.5;
        let distortion = [-0.3, 0.0, 0.0, 0.0, 0.0];
        let lens = PinholeLens::from(&Pinhole { width, height, fx, fy, cx, cy, distortion });
        assert!((lens.max_r2 - 1.0 / 0.9).abs() < 1e-5);
        assert!(!lens.pixel([1.0, 0.0, 1.0])[0].is_nan());
        assert!(lens.pixel([1.8, 0.0, 1.0])[0].is_nan());
    }
}
