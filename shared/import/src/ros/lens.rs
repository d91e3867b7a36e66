//! The lens model of a `CameraInfo`.

use super::messages::CameraInfo;
use geometry::{CameraModel, KannalaBrandt, Pinhole};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;

/// Largest residual of a lens approximation, px.
const MAX_RESIDUAL_PX: f64 = 0.1;
/// Points across the image at which lenses are compared.
const GRID: u32 = 24;
/// Number of angles up to pi that are tested for the corners of a fisheye image: steps of 0.06 deg.
const N_STEPS: u32 = 3000;

/// The lens of the raw image, or of the rectified one.
pub(crate) fn lens(info: &CameraInfo, is_rectified: bool) -> Result<CameraModel, String> {
    let width = info.width;
    let height = info.height;
    if info.binning.iter().any(|n| *n > 1) || info.region != [0; 4] && info.region != [0, 0, height, width] {
        return Err(format!("binning {:?} and region {:?} must cover the whole image", info.binning, info.region));
    }
    let k = &info.intrinsics;
    let p = &info.projection;
    let [fx, fy, cx, cy] = if is_rectified { [p[0], p[5], p[2], p[6]] } else { [k[0], k[4], k[2], k[5]] };
    let is_calibrated = [fx, fy, cx, cy].iter().all(|v| v.is_finite()) && fx > 0.0 && fy > 0.0;
    if !is_calibrated || width == 0 || height == 0 {
        return Err(format!("the camera is not calibrated: size {width} x {height}, focal lengths {fx} and {fy}"));
    }
    let d = &info.distortion;
    if d.iter().any(|v| !v.is_finite()) {
        return Err(format!("distortion {d:?} must be finite numbers"));
    }
    let pinhole = |distortion| Pinhole { width, height, fx, fy, cx, cy, distortion };
    if is_rectified || d.iter().all(|v| *v == 0.0) && info.distortion_model != "equidistant" {
        return Ok(CameraModel::Pinhole(pinhole([0.0; 5])));
    }
    match (info.distortion_model.as_str(), &d[..]) {
        ("plumb_bob", [k1, k2, p1, p2]) => Ok(CameraModel::Pinhole(pinhole([*k1, *k2, *p1, *p2, 0.0]))),
        ("plumb_bob", [k1, k2, p1, p2, k3]) => Ok(CameraModel::Pinhole(pinhole([*k1, *k2, *p1, *p2, *k3]))),
        ("rational_polynomial", d) if d.len() >= 8 && d[8..].iter().all(|v| *v == 0.0) => {
            fitted(&pinhole([0.0; 5]), d).map(CameraModel::Pinhole)
        }
        ("equidistant" | "fisheye", [] | [_, _, _, _]) => {
            let mut distortion = [0.0; 4];
            distortion.iter_mut().zip(d).for_each(|(own, value)| *own = *value);
            let corner = |x: f64, y: f64| ((x - cx) / fx).hypot((y - cy) / fy);
            let right = f64::from(width);
            let bottom = f64::from(height);
            let radius = [corner(0.0, 0.0), corner(right, 0.0), corner(0.0, bottom), corner(right, bottom)];
            let max_angle = angle_at(&distortion, radius.into_iter().fold(0.0, f64::max));
            Ok(CameraModel::KannalaBrandt(KannalaBrandt { width, height, fx, fy, cx, cy, distortion, max_angle }))
        }
        (model, d) => Err(format!(
            "distortion model {model:?} with {} values; must be plumb_bob (4 or 5), rational_polynomial (8) or equidistant (4)",
            d.len()
        )),
    }
}

/// Angle from the axis at which the radius is reached, or stops growing.
fn angle_at([k1, k2, k3, k4]: &[f64; 4], radius: f64) -> f64 {
    let mut reached = 0.0;
    // The range of the lens model is up to pi.
    for step in 1..=N_STEPS {
        let angle = f64::from(step) / f64::from(N_STEPS) * PI;
        let t2 = angle * angle;
        let found = angle * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
        if found <= reached || found > radius {
            return angle;
        }
        reached = found;
    }
    PI
}

/// The polynomial lens nearest to a rational one.
fn fitted(lens: &Pinhole, d: &[f64]) -> Result<Pinhole, String> {
    let rational = |x: f64, y: f64| {
        let r2 = x * x + y * y;
        let radial = (1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1.0 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
        [
            x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x),
            y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y,
        ]
    };
    let size = [f64::from(lens.width), f64::from(lens.height)];
    let directions = (0..=GRID).flat_map(|i| (0..=GRID).map(move |j| [i, j])).filter_map(|cell| {
        let [u, v] = [0, 1].map(|axis| f64::from(cell[axis]) / f64::from(GRID) * size[axis] - 0.5);
        undistorted(&rational, [(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy])
    });
    let directions: Vec<[f64; 2]> = directions.collect();
    let n_expected = (GRID as usize + 1).pow(2);
    if directions.len() < n_expected {
        let n_without = n_expected - directions.len();
        return Err(format!("rational_polynomial {d:?}: {n_without} of {n_expected} pixels have no direction"));
    }
    // Linear in k1 k2 p1 p2 k3.
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    let mut right = SVector::<f64, 5>::zeros();
    for [x, y] in &directions {
        let r2 = x * x + y * y;
        let [found_x, found_y] = rational(*x, *y);
        let of_x = SVector::<f64, 5>::from([x * r2, x * r2 * r2, 2.0 * x * y, r2 + 2.0 * x * x, x * r2 * r2 * r2]);
        let of_y = SVector::<f64, 5>::from([y * r2, y * r2 * r2, r2 + 2.0 * y * y, 2.0 * x * y, y * r2 * r2 * r2]);
        normal += of_x * of_x.transpose() + of_y * of_y.transpose();
        right += of_x * (found_x - x) + of_y * (found_y - y);
    }
    let solution =
        normal.lu().solve(&right).ok_or_else(|| format!("rational_polynomial {d:?} has no polynomial near it"))?;
    let lens = Pinhole { distortion: solution.into(), ..lens.clone() };
    let model = CameraModel::Pinhole(lens.clone());
    let off_px = |[x, y]: &[f64; 2]| {
        let [u, v] = rational(*x, *y);
        // At most half a pixel outside the image: the model may have no direction there.
        let pixel = nalgebra::Vector2::new(lens.fx * u + lens.cx, lens.fy * v + lens.cy);
        let ray = model.ray_from_pixel(&pixel)?;
        let angle_off = nalgebra::Vector2::new(ray.x / ray.z - x, ray.y / ray.z - y);
        Some((angle_off.x * lens.fx).hypot(angle_off.y * lens.fy))
    };
    let residual_px = directions.iter().map(|direction| off_px(direction).unwrap_or(f64::INFINITY)).fold(0.0, f64::max);
    if residual_px > MAX_RESIDUAL_PX {
        return Err(format!(
            "rational_polynomial {d:?} is {residual_px:.2} px from the nearest plumb_bob; at most {MAX_RESIDUAL_PX} px are accepted"
        ));
    }
    Ok(lens)
}

/// The direction that is distorted to `point`.
fn undistorted(distort: &impl Fn(f64, f64) -> [f64; 2], point: [f64; 2]) -> Option<[f64; 2]> {
    let [mut x, mut y] = point;
    for _ in 0..100 {
        let [found_x, found_y] = distort(x, y);
        x = x + point[0] - found_x;
        y = y + point[1] - found_y;
    }
    let [found_x, found_y] = distort(x, y);
    ((found_x - point[0]).hypot(found_y - point[1]) < 1e-9).then_some([x, y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::messages::Header;
    use geometry::Point3;

    fn info(distortion_model: &str, distortion: &[f64]) -> CameraInfo {
        CameraInfo {
            header: Header { stamp: 0, frame: "camera".into() },
            height: 480,
            width: 640,
            distortion_model: distortion_model.into(),
            distortion: distortion.to_vec(),
            intrinsics: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
            rectification: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            projection: [450.0, 0.0, 310.0, 0.0, 0.0, 460.0, 230.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            binning: [0; 2],
            region: [0; 4],
        }
    }

    #[test]
    fn plumb_bob_keeps_its_values_and_rectified_images_have_none() {
        let info = info("plumb_bob", &[-0.2, 0.05, 0.001, -0.0005, 0.01]);
        let CameraModel::Pinhole(raw) = lens(&info, false).expect("converts") else { panic!("not a pinhole") };
        assert_eq!((raw.fx, raw.cy, raw.distortion), (500.0, 240.0, [-0.2, 0.05, 0.001, -0.0005, 0.01]));
        let CameraModel::Pinhole(rectified) = lens(&info, true).expect("converts") else { panic!("not a pinhole") };
        assert_eq!((rectified.fx, rectified.cy, rectified.distortion), (450.0, 230.0, [0.0; 5]));
    }

    #[test]
    fn rational_lens_is_fitted_within_a_tenth_of_a_pixel_or_refused() {
        let d = [0.1, -0.05, 0.0005, -0.0003, 0.01, 0.3, 0.02, 0.0];
        let model = lens(&info("rational_polynomial", &d), false).expect("converts");
        for (x, y) in [(0.0_f64, 0.0_f64), (0.5, 0.3), (-0.6, 0.4), (0.2, -0.45)] {
            let r2 = x * x + y * y;
            let radial = (1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1.0 + r2 * (d[5] + r2 * d[6]));
            let u = x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x);
            let v = y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y;
            let found = model.pixel_from_camera(&Point3::new(x, y, 1.0)).expect("inside");
            assert!((found.x - 500.0 * u - 320.0).hypot(found.y - 510.0 * v - 240.0) < 0.1, "{x} {y}: {found}");
        }
        let strong = [20.0, 30.0, 0.0, 0.0, 5.0, 20.3, 40.0, 10.0];
        let error = lens(&info("rational_polynomial", &strong), false).expect_err("is refused");
        assert!(error.contains("px from the nearest plumb_bob"), "{error}");
    }

    #[test]
    fn equidistant_lens_reaches_the_corners() {
        let CameraModel::KannalaBrandt(found) =
            lens(&info("equidistant", &[-0.01, 0.002, 0.0, 0.0]), false).expect("converts")
        else {
            panic!("not a fisheye")
        };
        assert_eq!(found.distortion, [-0.01, 0.002, 0.0, 0.0]);
        let model = CameraModel::KannalaBrandt(found.clone());
        let corner = model.ray_from_pixel(&nalgebra::Vector2::new(0.0, 0.0)).expect("is seen");
        assert!(corner.z > 0.0 && (found.max_angle - corner.z.acos()).abs() < 0.01, "{corner} {}", found.max_angle);
    }

    #[test]
    fn uncalibrated_and_unknown_lenses_are_refused() {
        let good = info("plumb_bob", &[0.1; 5]);
        for (bad, rule) in [
            (CameraInfo { intrinsics: [0.0; 9], ..good.clone() }, "is not calibrated"),
            (CameraInfo { binning: [2, 2], ..good.clone() }, "binning [2, 2]"),
            (CameraInfo { region: [1, 0, 480, 640], ..good.clone() }, "region [1, 0, 480, 640]"),
            (CameraInfo { distortion_model: "magic".into(), ..good.clone() }, "\"magic\" with 5 values"),
            (CameraInfo { distortion: vec![f64::NAN; 5], ..good.clone() }, "must be finite"),
        ] {
            let error = lens(&bad, false).expect_err(rule);
            assert!(error.contains(rule), "{error}");
        }
    }
}
