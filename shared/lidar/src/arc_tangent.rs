//! Fast arc tangent of a direction.

/// The angle of (x, y) in -pi to pi, within 2e-5 rad (a hundredth of a column); 0 for the origin. The polynomial is the
/// minimax one of degree 11 for the arc tangent on 0 to 1.
#[inline(always)]
pub fn fast_atan2(y: f32, x: f32) -> f32 {
    let short = x.abs().min(y.abs());
    let long = x.abs().max(y.abs());
    let a = if long > 0.0 { short / long } else { 0.0 };
    let s = a * a;
    let p = ((((-0.011_721_2 * s + 0.052_653_32) * s - 0.116_432_87) * s + 0.193_543_46) * s - 0.332_623_47) * s
        + 0.999_977_26;
    let within_octant = p * a;
    let within_quadrant = if y.abs() > x.abs() { std::f32::consts::FRAC_PI_2 - within_octant } else { within_octant };
    let upper = if x < 0.0 { std::f32::consts::PI - within_quadrant } else { within_quadrant };
    if y < 0.0 { -upper } else { upper }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_atan2_is_within_2e_5() {
        for i in -1800..=1800_i16 {
            let angle = f32::from(i) * 0.1_f32.to_radians() * 0.999;
            for range in [1e-3, 1.0, 300.0] {
                let found = fast_atan2(range * angle.sin(), range * angle.cos());
                assert!((found - angle).abs() < 2e-5, "{found} for {angle}");
            }
        }
        assert_eq!(fast_atan2(0.0, 0.0), 0.0);
    }
}
