//! Fisheye lens after Kannala and Brandt.

use super::NOWHERE;
use geometry::KannalaBrandt;

/// Number of coefficients of the radius polynomial. Its error falls as `2.6^-n` for the widest lens below, and faster for
/// narrower lenses: 13 coefficients leave less than 0.001 px if the field of view ends at 1.5 rad from the axis, 0.01 px
/// if it ends at 2.2.
const N_COEFFICIENTS: usize = 13;

/// Largest angle from the axis, rad (250 degrees field of view). The fitted function has its pole at pi.
const MAX_ANGLE: f64 = 2.2;

/// [`KannalaBrandt`], prepared: `radius(t) / sin(t)` as a polynomial of `cos(t)`. This function is smooth, and no angle
/// needs to be computed.
#[derive(Clone, Debug)]
pub struct FisheyeLens {
    focal: [f32; 2],
    center: [f32; 2],
    min_cosine: f32,
    /// Scale and offset that map the visible cosines to -1 to 1, the domain of the polynomial.
    to_unit: [f32; 2],
    /// Polynomial coefficients, constant term first.
    coefficients: [f32; N_COEFFICIENTS],
}

impl From<&KannalaBrandt> for FisheyeLens {
    fn from(model: &KannalaBrandt) -> Self {
        let min_cosine = model.max_angle.min(MAX_ANGLE).cos();
        let [k1, k2, k3, k4] = model.distortion;
        let scale = |x: f64| {
            let angle = (0.5 * ((1.0 - min_cosine) * x + 1.0 + min_cosine)).clamp(-1.0, 1.0).acos();
            let t2 = angle * angle;
            let stretch = 1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)));
            // On the axis, t / sin(t) tends to 1.
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

/// The polynomial that equals a function on -1 to 1 at the Chebyshev nodes, constant term first.
fn polynomial(function: impl Fn(f64) -> f64) -> [f64; N_COEFFICIENTS] {
    let n = N_COEFFICIENTS as f64;
    let angle_of = |node: usize| std::f64::consts::PI * (node as f64 + 0.5) / n;
    let values: [f64; N_COEFFICIENTS] = std::array::from_fn(|node| function(angle_of(node).cos()));
    let mut sum = [0.0; N_COEFFICIENTS];
    // Chebyshev polynomials of the previous and the current order, as coefficients of powers.
    let mut before = [0.0; N_COEFFICIENTS];
    let mut here = [0.0; N_COEFFICIENTS];
    here[0] = 1.0;
    for order in 0..N_COEFFICIENTS {
        let weight = if order == 0 { 1.0 } else { 2.0 };
        let terms = values.iter().enumerate().map(|(node, value)| value * (order as f64 * angle_of(node)).cos());
        let share = weight / n * terms.sum::<f64>();
        let mut next = before.map(|c| -c);
        for power in 0..N_COEFFICIENTS {
            sum[power] += share * here[power];
            if power > 0 {
                // The factor of x is 1 for order 1 and 2 for all later ones.
                next[power] += weight * here[power - 1];
            }
        }
        before = here;
        here = next;
    }
    sum
}

impl FisheyeLens {
    /// See [`super::Lens::widest_slope`].
    pub fn widest_slope(&self) -> Option<f64> {
        let cosine = f64::from(self.min_cosine);
        (cosine > 0.1).then(|| (1.0 - cosine * cosine).sqrt() / cosine)
    }

    /// See [`super::Lens::px_per_rad`].
    #[inline]
    pub fn px_per_rad(&self) -> f32 {
        self.focal[0]
    }

    /// See [`super::Lens::pixel`].
    #[inline(always)]
    pub fn pixel(&self, [x, y, z]: [f32; 3]) -> [f32; 2] {
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let cosine = z * inverse;
        // A point at the center of the lens has no direction: its cosine is NaN, which fails this comparison.
        let is_in_view = cosine >= self.min_cosine;
        let at = cosine * self.to_unit[0] + self.to_unit[1];
        let value = self.coefficients.iter().rev().fold(0.0, |value, coefficient| value * at + coefficient);
        let scale = inverse * value;
        let pixel = [self.focal[0] * x * scale + self.center[0], self.focal[1] * y * scale + self.center[1]];
        if is_in_view { pixel } else { NOWHERE }
    }
}
