//! Ladybug calibration files: a real one, and damaged ones.

use formats::ladybug::LadybugCalibration;
use geometry::{CameraModel, Point3, Vector2};

fn real() -> String {
    std::fs::read_to_string(real_data::path("ladybug5/ladybug16146039-20m.cal")).expect("readable")
}

#[real_data::test("ladybug5/ladybug16146039-20m.cal")]
fn real_cameras_project_the_reference_points_of_the_file_to_its_pixels() {
    let calibration: LadybugCalibration = real().parse().expect("the maker's own file");
    assert_eq!((calibration.serial.as_str(), calibration.cameras.len()), ("16146039", 6));
    for camera in &calibration.cameras {
        let mut apart_px = Vec::new();
        for (p_in_ladybug, pixel) in &camera.pairs {
            let p = camera.ladybug_from_camera.inverse() * Point3::from(*p_in_ladybug);
            let lens = &camera.lens;
            let found = [lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy];
            for axis in 0..2 {
                assert!((found[axis] - pixel[axis]).abs() < 0.01, "{found:?} instead of {pixel:?}");
            }
            let sensor = lens.project(&p, 0.0).expect("in view");
            apart_px.push((sensor - Vector2::from(*pixel)).norm());
        }
        // The first point is the center. The ideal image is a rectangle around the curved image of the sensor: they touch
        // in one corner.
        let corners_px = &mut apart_px[1..];
        corners_px.sort_by(f64::total_cmp);
        assert!(corners_px[0] < 0.003 && corners_px[1] > 5.0 && corners_px[3] < 55.0, "{corners_px:?} px");
    }
}

#[real_data::test("ladybug5/ladybug16146039-20m.cal")]
fn pixel_of_real_camera_maps_to_ray_and_back() {
    let calibration: LadybugCalibration = real().parse().expect("the maker's own file");
    for camera in calibration.cameras {
        let [fx, fy] = camera.lens.px_per_rad();
        assert!((1225.0..1245.0).contains(&fx) && (1225.0..1245.0).contains(&fy), "{fx} {fy} px/rad");
        let model = CameraModel::SplineWarp(camera.lens);
        let mut n_seen = 0;
        let mut n_all = 0;
        let mut worst = 0.0_f64;
        for u in (0..2448).step_by(17) {
            for v in (0..2048).step_by(19) {
                n_all += 1;
                let pixel = Vector2::new(f64::from(u), f64::from(v));
                let Some(ray) = model.ray_from_pixel(&pixel) else { continue };
                let back =
                    model.pixel_from_camera(&Point3::from(ray * 9.0)).unwrap_or_else(|| panic!("{pixel} of {ray}"));
                worst = worst.max((back - pixel).norm());
                n_seen += 1;
            }
        }
        // In the corners, the ideal image ends before the sensor image.
        assert!(worst < 0.05 && n_seen * 1000 > n_all * 995, "{n_seen} of {n_all} pixels, worst {worst} px");
    }
}

#[real_data::test("ladybug5/ladybug16146039-20m.cal")]
fn real_lens_survives_toml_round_trip() {
    let calibration: LadybugCalibration = real().parse().expect("the maker's own file");
    let model = CameraModel::SplineWarp(calibration.cameras[0].lens.clone());
    let back: CameraModel = toml::from_str(&toml::to_string(&model).expect("numbers")).expect("as written");
    assert_eq!(model, back);
}

#[test]
fn invalid_text_is_reported_with_its_line() {
    let error = |text: &str| text.parse::<LadybugCalibration>().expect_err("damaged").to_string();
    assert_eq!(error("hello"), "line 1: not a Ladybug calibration: no Resolution");
    assert_eq!(error("Resolution 2448"), "line 1: Resolution has 1 numbers; expected 2");
    assert_eq!(error("Resolution 20 x"), "line 1: \"x\" is not a number");
    assert_eq!(error("Resolution 20 10\n\nBeginCamera\nId 0\n"), "line 3: no EndCamera up to the end of the file");
    let warp = "BeginWarp\nId 0\nKnotsX 0\nKnotsY 0\nNumberCoefs 2 2\nCoefs\n1 2 3\nEndWarp\n";
    assert_eq!(error(&format!("Resolution 20 10\n{warp}")), "line 7: 3 coefficients; expected 2 times 2");
    let camera = "BeginCamera\nId 0\nEndCamera\n";
    assert_eq!(error(&format!("Resolution 20 10\n{camera}")), "line 2: the camera has no focalLength");
}

#[real_data::test("ladybug5/ladybug16146039-20m.cal")]
fn truncated_real_file_is_refused() {
    let text = real();
    for cut in (0..text.len()).step_by(4001) {
        assert!(text[..cut].parse::<LadybugCalibration>().is_err(), "cut at {cut}");
    }
    let gone = text.replacen("\n  RectifiedSpline 0 1", "\n  RectifiedSpline 0 99", 1);
    let error = gone.parse::<LadybugCalibration>().expect_err("damaged").to_string();
    assert!(error.contains("spline 99 is missing"), "{error}");
}
