//! Minimum-area bounding rectangle of 2-D points.

/// A rectangle of any orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedRectangle {
    /// x and y of its center, m.
    pub center: [f64; 2],
    /// Longer side, m.
    pub length_m: f64,
    /// Shorter side, m.
    pub width_m: f64,
    /// Angle from the x axis to the longer side, counter-clockwise, rad, -pi/2 to pi/2.
    pub heading: f64,
}

/// Number of tested orientations: a quarter turn in steps of one degree. An error of half a degree makes a 5 m long car
/// 2 cm wider.
const N_DIRECTIONS: u32 = 90;

impl OrientedRectangle {
    /// Rectangle of least area among orientations of whole degrees. `None` without points.
    pub fn around(points: &[[f64; 2]]) -> Option<Self> {
        let turned = |degrees: u32| {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let extent = |along: [f64; 2]| {
                let shadows = points.iter().map(|p| p[0] * along[0] + p[1] * along[1]);
                shadows.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
            };
            let [u0, u1] = extent([cos, sin]);
            let [v0, v1] = extent([-sin, cos]);
            let u = 0.5 * (u0 + u1);
            let v = 0.5 * (v0 + v1);
            let center = [u * cos - v * sin, u * sin + v * cos];
            let heading = f64::from(degrees).to_radians();
            if u1 - u0 >= v1 - v0 {
                Self { center, length_m: u1 - u0, width_m: v1 - v0, heading }
            } else {
                // The longer side is perpendicular.
                let heading = heading - std::f64::consts::FRAC_PI_2;
                Self { center, length_m: v1 - v0, width_m: u1 - u0, heading }
            }
        };
        let area = |r: &Self| r.length_m * r.width_m;
        let all = (!points.is_empty()).then(|| (0..N_DIRECTIONS).map(turned));
        all.into_iter().flatten().min_by(|a, b| area(a).total_cmp(&area(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangle_of_rotated_car_has_its_pose_and_size() {
        for degrees in [-89, -30, 0, 17, 45, 90] {
            let turn = f64::from(degrees).to_radians();
            let corners = [[-2.1, -0.9], [2.1, -0.9], [2.1, 0.9], [-2.1, 0.9], [1.0, 0.3]];
            let place =
                |[x, y]: [f64; 2]| [5.0 + x * turn.cos() - y * turn.sin(), -3.0 + x * turn.sin() + y * turn.cos()];
            let found = OrientedRectangle::around(&corners.map(place)).expect("has points");
            let values = [found.center[0] - 5.0, found.center[1] + 3.0, found.length_m - 4.2, found.width_m - 1.8];
            assert!(values.iter().all(|v| v.abs() < 1e-9), "{degrees}: {found:?}");
            assert!((found.heading - turn).sin().abs() < 1e-9, "{degrees}: {found:?}");
        }
        assert_eq!(OrientedRectangle::around(&[]), None);
        assert_eq!(OrientedRectangle::around(&[[1.0, 2.0]]).map(|r| (r.center, r.length_m)), Some(([1.0, 2.0], 0.0)));
    }
}
