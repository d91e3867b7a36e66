//! Projection in f32, fast: the exact models are [`geometry::CameraModel`], in f64. The two agree within 0.02 px.

use crate::warp_lens::WarpLens;
use geometry::{CameraModel, KannalaBrandt, Pinhole};

/// Nearer than a millimetre is inside the lens.
const MIN_DEPTH_M: f32 = 1e-3;

/// Coefficients of a fisheye's radius. The polynomial's error falls as `2.6^-n` for the widest lens below, and faster for
/// narrower ones: 13 leave less than 0.001 px where the lens ends at 1.5 rad from the axis, 0.01 px where it ends at 2.2.
const N_COEFFICIENTS: usize = 13;

/// Beyond this angle from the axis no lens sees (250 degrees of view), and the polynomial's function has its pole at pi.
const MAX_ANGLE: f64 = 2.2;

/// A camera model, prepared.
#[derive(Clone, Debug)]
pub enum Lens {
    /// See [`geometry::Pinhole`].
    Pinhole(PinholeLens),
    /// See [`geometry::KannalaBrandt`].
    Fisheye(FisheyeLens),
    /// See [`geometry::SplineWarp`].
    Warp(WarpLens),
}

/// What the lens does not see falls here. Not a number is in no image, and a loop that writes it has no jumps.
const NOWHERE: [f32; 2] = [f32::NAN; 2];

impl Lens {
    /// Largest slope against the axis that is seen; `None` for lenses that see sideways.
    pub fn widest_slope(&self) -> Option<f64> {
        match self {
            Lens::Pinhole(lens) => Some(f64::from(lens.max_r2).sqrt()),
            Lens::Fisheye(lens) => {
                let cosine = f64::from(lens.min_cosine);
                (cosine > 0.1).then(|| (1.0 - cosine * cosine).sqrt() / cosine)
            }
            Lens::Warp(lens) => Some(lens.widest_slope()),
        }
    }
    /// On the axis.
    pub fn px_per_rad(&self) -> f32 {
        match self {
            Lens::Pinhole(lens) => lens.focal[0],
            Lens::Fisheye(lens) => lens.focal[0],
            Lens::Warp(lens) => lens.px_per_rad(),
        }
    }
    /// Where a point of the camera frame (x right, y down, z forward, m) falls on the image plane, px; NaN where the lens
    /// cannot see.
    pub fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        match self {
            Lens::Pinhole(lens) => lens.pixel(p_in_camera),
            Lens::Fisheye(lens) => lens.pixel(p_in_camera),
            Lens::Warp(lens) => lens.pixel(p_in_camera),
        }
    }
}

/// Brown-Conrady.
#[derive(Clone, Debug)]
pub struct PinholeLens {
    focal: [f32; 2],
    center: [f32; 2],
    distortion: [f32; 5],
    max_r2: f32,
}

/// Kannala-Brandt, with `radius(t) / sin(t)` as a polynomial of `cos(t)`: a smooth function, so that no angle has to be computed.
#[derive(Clone, Debug)]
pub struct FisheyeLens {
    focal: [f32; 2],
    center: [f32; 2],
    min_cosine: f32,
    /// The cosine times the first plus the second is in -1 to 1, where the polynomial is.
    to_unit: [f32; 2],
    /// From the constant upward.
    coefficients: [f32; N_COEFFICIENTS],
}

impl From<&CameraModel> for Lens {
    fn from(model: &CameraModel) -> Self {
        match model {
            CameraModel::Pinhole(model) => Lens::Pinhole(model.into()),
            CameraModel::KannalaBrandt(model) => Lens::Fisheye(model.into()),
            CameraModel::SplineWarp(model) => Lens::Warp(model.into()),
        }
    }
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

/// Where the model's distortion turns, by bisection; at most 89.4 degrees from the axis.
fn largest_monotone_r2(model: &Pinhole) -> f64 {
    let (mut low, mut high) = (0.0, 1e4);
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
    /// See [`Lens::pixel`].
    #[inline(always)]
    pub fn pixel(&self, [x, y, z]: [f32; 3]) -> [f32; 2] {
        let is_ahead = z > MIN_DEPTH_M;
        let inverse = 1.0 / z;
        let (x, y) = (x * inverse, y * inverse);
        let r2 = x * x + y * y;
        let [k1, k2, p1, p2, k3] = self.distortion;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        // NaN is not above anything.
        let is_in_view = is_ahead & (r2 <= self.max_r2);
        let pixel = [self.focal[0] * xd + self.center[0], self.focal[1] * yd + self.center[1]];
        if is_in_view { pixel } else { NOWHERE }
    }
}

impl From<&KannalaBrandt> for FisheyeLens {
    fn from(model: &KannalaBrandt) -> Self {
        let min_cosine = model.max_angle.min(MAX_ANGLE).cos();
        let [k1, k2, k3, k4] = model.distortion;
        let scale = |x: f64| {
            let angle = (0.5 * ((1.0 - min_cosine) * x + 1.0 + min_cosine)).clamp(-1.0, 1.0).acos();
            let t2 = angle * angle;
            let stretch = 1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)));
            // On the axis t / sin(t) tends to 1.
            let slant = if angle > 1e-9 { angle / angle.sin() } else { 1.0 };
            slant * stretch
        };
        Self {
            focal: [model.fx as f32, model.fy as f32],
            center: [model.cx as f32, model.cy as f32],
            min_cosine: min_cosine as f32,
            to_unit: [2.0 / (1.0 - min_cosine), -(1.0 + min_cosine) / (1.0 - min_cosine)].map(|v| v as f32),
            coefficients: polynomial(scale).map(|c| c as f32),
        }
    }
}

/// Of a function on -1 to 1, through its values at Chebyshev's nodes; from the constant upward.
fn polynomial(function: impl Fn(f64) -> f64) -> [f64; N_COEFFICIENTS] {
    let n = N_COEFFICIENTS as f64;
    let angle_of = |node: usize| std::f64::consts::PI * (node as f64 + 0.5) / n;
    let values: [f64; N_COEFFICIENTS] = std::array::from_fn(|node| function(angle_of(node).cos()));
    let mut sum = [0.0; N_COEFFICIENTS];
    // Chebyshev's polynomials of the order before and of this one, in powers.
    let (mut before, mut here) = ([0.0; N_COEFFICIENTS], [0.0; N_COEFFICIENTS]);
    here[0] = 1.0;
    for order in 0..N_COEFFICIENTS {
        let weight = if order == 0 { 1.0 } else { 2.0 };
        let terms = values.iter().enumerate().map(|(node, value)| value * (order as f64 * angle_of(node)).cos());
        let share = weight / n * terms.sum::<f64>();
        let mut next = before.map(|c| -c);
        for power in 0..N_COEFFICIENTS {
            sum[power] += share * here[power];
            if power > 0 {
                // Of the order 1 there is one x, of all later ones two.
                next[power] += weight * here[power - 1];
            }
        }
        (before, here) = (here, next);
    }
    sum
}

impl FisheyeLens {
    /// See [`Lens::pixel`].
    #[inline(always)]
    pub fn pixel(&self, [x, y, z]: [f32; 3]) -> [f32; 2] {
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let cosine = z * inverse;
        // A point in the lens has no direction: its cosine is NaN, which is not above anything.
        let is_in_view = cosine >= self.min_cosine;
        let at = cosine * self.to_unit[0] + self.to_unit[1];
        let value = self.coefficients.iter().rev().fold(0.0, |value, coefficient| value * at + coefficient);
        let scale = inverse * value;
        let pixel = [self.focal[0] * x * scale + self.center[0], self.focal[1] * y * scale + self.center[1]];
        if is_in_view { pixel } else { NOWHERE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;

    fn compare(model: &CameraModel) -> usize {
        let lens = Lens::from(model);
        let mut n_seen = 0;
        for i in 0..200_u32 {
            for j in 0..200_u32 {
                // All directions, some on the axes, at changing distance.
                let (azimuth, polar) = (f64::from(i) * 0.0314, f64::from(j) * 0.0157);
                let direction = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
                let p = direction.map(|v| v * (0.5 + f64::from(j % 50)));
                let p_in_camera = p.map(|v| v as f32);
                let fast = lens.pixel(p_in_camera);
                let Some(exact) = model.pixel_from_camera(&Point3::from(p)) else { continue };
                let error = (f64::from(fast[0]) - exact.x).hypot(f64::from(fast[1]) - exact.y);
                // What the exact model sees, the fast one sees: NaN is not below anything.
                assert!(error < 0.02, "{p:?}: {fast:?} instead of {exact}");
                n_seen += 1;
            }
        }
        n_seen
    }

    fn pinhole(distortion: [f64; 5]) -> CameraModel {
        let (width, height, fx, fy, cx, cy) = (1600, 900, 1266.4, 1260.0, 816.3, 491.5);
        CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion })
    }

    fn fisheye(max_angle: f64) -> CameraModel {
        let (width, height, fx, fy, cx, cy) = (2048, 2448, 1236.0, 1240.0, 1020.0, 1230.0);
        let distortion = [-0.02, 0.004, -0.001, 0.0001];
        CameraModel::KannalaBrandt(KannalaBrandt { width, height, fx, fy, cx, cy, distortion, max_angle })
    }

    /// The spline's lens: straight knots for an image as a pinhole has it, bent like a fisheye's.
    fn warp() -> CameraModel {
        let (width, height, fx, fy, cx, cy) = (2448, 2048, 460.0, 459.0, 1216.0, 1040.0);
        let surface = |along: usize| {
            let n = 23_i32;
            // The middle of the knots that a coefficient belongs to, as a share.
            let place = |i: i32| f64::from((0..3).map(|k| (i + k - 2).clamp(0, n - 3)).sum::<i32>()) / 60.0;
            let bent = |i: i32, j: i32| {
                let (x, y) = (2.0 * place(i) - 1.0, 2.0 * place(j) - 1.0);
                let (x, y) = (x * 2.66, y * 2.23);
                let r = x.hypot(y).max(1e-9);
                let angle = r.atan() * (1.0 + 0.01 * x);
                0.5 + if along == 0 { 0.5066 * x } else { 0.605 * y } * angle / r
            };
            (0..n).map(|i| (0..n).map(|j| bent(i, j)).collect()).collect::<Vec<Vec<f64>>>()
        };
        let [warp_u, warp_v] = [0, 1].map(|along| surface(along).try_into().expect("a grid"));
        CameraModel::SplineWarp(geometry::SplineWarp { width, height, fx, fy, cx, cy, warp_u, warp_v })
    }

    #[test]
    fn fast_and_exact_projection_agree() {
        assert!(compare(&warp()) > 1000);
        assert!(compare(&pinhole([0.0; 5])) > 1000);
        assert!(compare(&pinhole([-0.25, 0.08, 0.001, -0.0007, -0.01])) > 1000);
        assert!(compare(&fisheye(1.2)) > 1000);
        assert!(compare(&fisheye(2.0)) > 1000);
    }

    #[test]
    fn fast_and_exact_projection_of_a_real_ladybug_agree() {
        let Some(path) = real_data::real_data("ladybug5/ladybug16146039-20m.cal") else { return };
        let text = std::fs::read_to_string(path).expect("readable");
        let calibration: formats::ladybug::LadybugCalibration = text.parse().expect("the maker's own file");
        for camera in calibration.cameras {
            assert!(compare(&CameraModel::SplineWarp(camera.lens)) > 1000);
        }
    }

    #[test]
    fn nothing_is_seen_where_there_is_nothing_to_see() {
        for lens in [Lens::from(&pinhole([0.0; 5])), Lens::from(&fisheye(1.5)), Lens::from(&warp())] {
            for p in [[0.0, 0.0, -2.0], [0.0, 0.0, 0.0], [f32::NAN, 0.0, 1.0], [0.0, 0.0, f32::NAN], [5.0, 0.0, -1.0]] {
                assert!(lens.pixel(p)[0].is_nan(), "{p:?}");
            }
        }
    }

    #[test]
    fn directions_beyond_the_turn_of_the_distortion_are_not_seen() {
        let Lens::Pinhole(lens) = Lens::from(&pinhole([-0.3, 0.0, 0.0, 0.0, 0.0])) else { panic!("a pinhole") };
        assert!((lens.max_r2 - 1.0 / 0.9).abs() < 1e-5);
        assert!(!lens.pixel([1.0, 0.0, 1.0])[0].is_nan());
        assert!(lens.pixel([1.8, 0.0, 1.0])[0].is_nan());
    }
}
