//! Residuals of a cloud with known errors.

use crate::support::{utm, write_run};
use std::fmt::Write as _;
use surveying::RunFolder;
use surveying::check_points::{CheckPoint, load_check_points, write_check_points};

#[test]
fn surface_of_the_cloud_gives_the_residual_of_the_height() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("made");
    // A road with a grade of 5 %, and a roof 3 m above it.
    let road = |i: usize| {
        let x = (i % 200) as f64 * 0.1;
        let y = (i / 200) as f64 * 0.1;
        ([x, y, 0.05 * x + if i.is_multiple_of(3) { 3.0 } else { 0.0 }], 7)
    };
    write_run(&run, &[((0..8000).map(road).collect(), true)]);
    let opened = RunFolder::open(&run).expect("opens");
    let frame = utm(opened.georeference.as_ref().expect("is placed"));
    // The cloud is 7 cm above the first and 3 cm below the second check point. There are no points at the third; the
    // fourth has a position in the cloud.
    let at = |x: f64, y: f64, off: f64| {
        let [east, north, up] = frame.from_cloud([x, y, 0.05 * x]).expect("converts");
        (east, north, up + off)
    };
    let a = at(5.03, 1.02, -0.07);
    let b = at(12.0, 2.0, 0.03);
    let c = at(-50.0, 0.0, 0.0);
    let d = at(15.0, 2.0, 0.0);
    let file = folder.path().join("points.csv");
    let mut text = "name,x,y,z,cloud_x,cloud_y,cloud_z\n".to_owned();
    for (name, (x, y, z)) in [("A", a), ("B", b), ("C", c)] {
        let _ = writeln!(text, "{name},{x},{y},{z},,,");
    }
    let _ = writeln!(text, "D,{0},{1},{2},{3},{1},{2}", d.0, d.1, d.2, d.0 + 0.04);
    std::fs::write(&file, text).expect("writes");
    let comparison =
        write_check_points(std::slice::from_ref(&opened), &frame, load_check_points(&file).expect("loads"), &out)
            .expect("compares");
    let accuracy = &comparison.accuracy.check;
    let outside: Vec<&str> = comparison.outside().map(|point| point.name.as_str()).collect();
    assert_eq!((outside, comparison.unusable([[0.0; 3]; 2])), (vec!["C"], None));
    let table = std::fs::read_to_string(out.join("check_points.csv")).expect("was written");
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let number = |row: usize, column: usize| rows[row][column].parse::<f64>().expect("a number");
    assert!((number(0, 6) - 0.07).abs() < 2e-3 && (number(1, 6) + 0.03).abs() < 2e-3, "{table}");
    assert!(number(0, 7) > 30.0 && number(0, 8) < 2e-3, "{table}");
    assert_eq!((rows[2][6], rows[2][7]), ("", "0"));
    assert!((number(3, 4) - 0.04).abs() < 1e-6 && number(3, 5) == 0.0, "{table}");
    assert_eq!(accuracy.axes.map(|axis| axis.n), [1, 1, 3]);
    assert!((accuracy.ce90_m.expect("has one") - 0.04).abs() < 1e-6);
    let summary = std::fs::read_to_string(out.join("check_points_summary.csv")).expect("was written");
    assert!(summary.contains("rmse_x,1,0.0400") && summary.contains("le90,3,"), "{summary}");
    // Horizontally 4 cm, and 2 cm along each axis of the check point.
    assert!(summary.contains("class_h,1,0.05,check,not tested: 1 check points; 29 are missing"), "{summary}");
    assert!(summary.contains("ce95,1,0.0692,check,"), "{summary}");

    std::fs::write(&file, "name,x,y\n").expect("writes");
    let error = load_check_points(&file).expect_err("is refused").to_string();
    assert!(error.contains("points.csv: line 1: no column `z`"), "{error}");
}

#[test]
fn check_points_outside_of_the_cloud_are_reported_with_the_probable_cause() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let road = |i: usize| ([(i % 200) as f64 * 0.1, (i / 200) as f64 * 0.1, 0.0], 7);
    write_run(&run, &[((0..8000).map(road).collect(), true)]);
    let opened = RunFolder::open(&run).expect("opens");
    let frame = utm(opened.georeference.as_ref().expect("is placed"));
    let corner = |xyz| frame.from_cloud(xyz).expect("converts");
    let [east, north, up] = corner([10.0, 2.0, 0.0]);
    let cloud = [corner([0.0, 0.0, -0.1]), corner([20.0, 4.0, 0.1])];
    for (xyz, hint) in [
        ([north, east, up], "hint: x and y of the table are swapped"),
        (
            [east, north, up - 44.0],
            "hint: heights of the table and of the delivery refer to different surfaces; see --geoid",
        ),
        ([10.0, 2.0, 0.0], "hint: write the table in the coordinates of the delivery"),
    ] {
        let points = vec![CheckPoint { name: "A".to_owned(), xyz, ..CheckPoint::default() }];
        let comparison =
            write_check_points(std::slice::from_ref(&opened), &frame, points, folder.path()).expect("compares");
        let text = comparison.unusable(cloud).expect("is not usable");
        assert!(text.contains("none of 1 check points lies in the cloud") && text.contains(hint), "{text}");
        let x = format!("the check points have x {:.2} to {:.2}", xyz[0], xyz[0]);
        assert!(text.contains(&x), "{text}");
    }
}
