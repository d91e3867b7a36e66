//! Converts third-party lens models to camera models.

use geometry::{CameraModel, KannalaBrandt, Pinhole};

/// Largest angle of a fisheye, rad.
const MAX_ANGLE: f64 = 3.0;
/// Step of the search for the edge of a fisheye's image, rad.
const ANGLE_STEP: f64 = 0.001;

/// Intrinsics of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Intrinsics {
    /// Columns and rows of the image.
    pub size: [u32; 2],
    /// fx fy cx cy, px.
    pub numbers: [f64; 4],
}

/// Converts a lens of a named distortion model with its coefficients.
pub(super) fn lens(intrinsics: Intrinsics, model: &str, coefficients: &[f64]) -> Result<CameraModel, String> {
    let Intrinsics { size: [width, height], numbers: [fx, fy, cx, cy] } = intrinsics;
    if !(1..=32_768).contains(&width) || !(1..=32_768).contains(&height) {
        return Err(format!("image size {width} x {height}; must be 1 to 32768 px a side"));
    }
    if !(fx > 0.0 && fy > 0.0) {
        return Err(format!("focal lengths {fx}, {fy}; must be positive"));
    }
    let rest = |from: usize| coefficients.iter().skip(from).any(|value| *value != 0.0);
    match model {
        "none" | "" if !rest(0) => {
            Ok(CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] }))
        }
        "plumb_bob" | "radtan" | "rational_polynomial" | "none" | "" => {
            // Coefficients k1 k2 p1 p2 k3, then the coefficients of the rational model.
            if rest(5) {
                return Err(format!(
                    "{} distortion coefficients of which those after the fifth are not zero (rational model); calibrate with k1 k2 p1 p2 \
                     k3 (plumb_bob), or with a fisheye model",
                    coefficients.len()
                ));
            }
            let distortion = std::array::from_fn(|i| coefficients.get(i).copied().unwrap_or(0.0));
            Ok(CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion }))
        }
        "equidistant" | "equi" | "fisheye" | "kannala_brandt" => {
            if rest(4) {
                return Err(format!("{} coefficients; a fisheye has k1 k2 k3 k4", coefficients.len()));
            }
            let distortion = std::array::from_fn(|i| coefficients.get(i).copied().unwrap_or(0.0));
            let lens = KannalaBrandt { width, height, fx, fy, cx, cy, distortion, max_angle: MAX_ANGLE };
            let max_angle = widest(&lens);
            Ok(CameraModel::KannalaBrandt(KannalaBrandt { max_angle, ..lens }))
        }
        other => Err(format!(
            "lens model {other:?} is not supported; must be none, plumb_bob or radtan, equidistant or fisheye. Calibrate again with one of \
             these"
        )),
    }
}

/// The angle at the edge of the image: at its farthest corner, or where the polynomial of the lens is no longer
/// monotonic.
fn widest(lens: &KannalaBrandt) -> f64 {
    let radius = |angle: f64| {
        let [k1, k2, k3, k4] = lens.distortion;
        let square = angle * angle;
        angle * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    };
    let corner = [0.0, f64::from(lens.width)].into_iter().flat_map(|u| [0.0, f64::from(lens.height)].map(|v| (u, v)));
    let farthest = corner.map(|(u, v)| ((u - lens.cx) / lens.fx).hypot((v - lens.cy) / lens.fy)).fold(0.0, f64::max);
    let n_steps = (MAX_ANGLE / ANGLE_STEP) as u32;
    let angles = (1..=n_steps).map(|step| f64::from(step) * ANGLE_STEP);
    let inside = |angle: &f64| radius(*angle) > radius(angle - ANGLE_STEP) && radius(angle - ANGLE_STEP) < farthest;
    // Rounded down to the step precision, so that the text is short.
    let last = angles.take_while(inside).last().unwrap_or(ANGLE_STEP);
    (last * 1e3).round() * 1e-3
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Intrinsics = Intrinsics { size: [800, 600], numbers: [300.0, 300.0, 400.0, 300.0] };

    #[test]
    fn fisheye_ends_at_the_corner_or_where_it_turns_back() {
        let angle = |coefficients: &[f64]| match lens(PLAIN, "equidistant", coefficients).expect("a lens") {
            CameraModel::KannalaBrandt(lens) => lens.max_angle,
            other => panic!("{other:?}"),
        };
        // 500 px of 300 px per rad.
        assert!((angle(&[0.0; 4]) - 1.667).abs() < 1e-9);
        // The polynomial t - t^3 / 3 has its maximum at 1 rad.
        assert!((angle(&[-1.0 / 3.0]) - 1.0).abs() < 2e-3);
    }

    #[test]
    fn unsupported_models_are_refused_by_name() {
        let error = |model, coefficients: &[f64]| lens(PLAIN, model, coefficients).expect_err("refused");
        assert!(error("omni", &[0.0]).contains("\"omni\" is not supported"));
        assert!(error("rational_polynomial", &[0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0]).contains("rational model"));
        let sizeless = Intrinsics { size: [0, 600], ..PLAIN };
        assert!(lens(sizeless, "none", &[]).expect_err("refused").contains("image size 0 x 600"));
        let found = lens(PLAIN, "plumb_bob", &[-0.3, 0.1, 0.001, 0.002]).expect("a lens");
        let CameraModel::Pinhole(found) = found else { panic!("{found:?}") };
        assert_eq!(found.distortion, [-0.3, 0.1, 0.001, 0.002, 0.0]);
    }
}
