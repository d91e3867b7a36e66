//! The stage on the bench.

use infer::{Infer, Settings};
use messages::{CLASS_TABLE_VERSION, Class, ClassId, ClassRow, Color, ColorHeader, Submap, SubmapHeader, SubmapPoint};
use stage::testing::{Bench, context};
use stage::{Context, Stage};
use std::path::Path;

/// The project's root, where launch.toml and models/ are.
fn at_root() -> Context {
    context(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")))
}

fn bench() -> Bench<Infer> {
    Bench::new(&Settings::default(), &at_root()).expect("the shipped model loads")
}

/// A road of 20 m x 10 m that climbs by 5 %, with a box of 1.5 m height on it; the box's points come last.
fn road_with_box() -> (Vec<SubmapPoint>, usize) {
    let point = |x: f32, y: f32, above: f32| SubmapPoint { x, y, z: 0.05 * x + above, ..SubmapPoint::default() };
    let grid = |n: u16, step: f32| (0..n).map(move |i| f32::from(i) * step + 0.05);
    let mut points: Vec<SubmapPoint> =
        grid(200, 0.1).flat_map(|x| grid(100, 0.1).map(move |y| (x, y))).map(|(x, y)| point(x, y, 0.0)).collect();
    let n_road = points.len();
    points.extend(grid(40, 0.1).flat_map(|x| grid(18, 0.1).map(move |y| point(x + 8.0, y + 4.0, 1.5))));
    (points, n_road)
}

#[test]
fn every_submap_gets_a_class_column_of_its_own_length_and_number() {
    let mut bench = bench();
    let (points, n_road) = road_with_box();
    let n_points = points.len();
    bench.send::<Submap>(70, SubmapHeader::default(), points);
    bench.send::<Color>(70, ColorHeader::default(), Vec::new());
    bench.send::<Submap>(80, SubmapHeader::default(), Vec::new());
    bench.tick().expect("steps");
    bench.tick().expect("steps without input");
    let columns = bench.take::<Class>();
    let shapes: Vec<_> = columns.iter().map(|column| (column.seq(), column.stamp(), column.rows().len())).collect();
    assert_eq!(shapes, [(0, 70, n_points), (1, 80, 0)]);
    let header = columns[0].header();
    assert_eq!(header.class_table_version, CLASS_TABLE_VERSION);
    assert_ne!(header.model_digest, 0);
    let is_ground = |row: &ClassRow| row.class_id == ClassId::Ground as u8 && row.score > 127;
    assert!(columns[0].rows()[..n_road].iter().all(is_ground));
    assert!(columns[0].rows()[n_road..].iter().all(|row| *row == ClassRow::default()));
    assert_eq!(bench.counter("points_unseen"), 0);
}

#[test]
fn points_that_are_no_numbers_are_counted_and_stay_unlabeled() {
    let mut bench = bench();
    let (mut points, n_road) = road_with_box();
    points[7].x = f32::NAN;
    points[8].z = f32::INFINITY;
    bench.send::<Submap>(0, SubmapHeader::default(), points);
    bench.tick().expect("steps");
    let columns = bench.take::<Class>();
    assert_eq!(bench.counter("points_unseen"), 2);
    assert_eq!(columns[0].rows().iter().filter(|row| row.score > 0).count(), n_road - 2);
}

#[test]
fn a_restart_in_mid_stream_changes_nothing() {
    let outputs = |restart: bool| {
        let mut bench = bench();
        let mut rows = Vec::new();
        for seq in 0..4 {
            let (mut points, _) = road_with_box();
            points.truncate(points.len() - 100 * seq);
            bench.send::<Submap>(seq as i64, SubmapHeader::default(), points);
            bench.tick().expect("steps");
            rows.extend(bench.take::<Class>().iter().map(|column| (column.seq(), column.rows().to_vec())));
            if restart && seq == 1 {
                bench = bench.restarted(&Settings::default(), &at_root()).expect("restarts");
            }
        }
        rows
    };
    let undisturbed = outputs(false);
    assert_eq!(undisturbed.len(), 4);
    assert!(outputs(true) == undisturbed);
}

#[test]
fn absent_and_broken_models_are_found_before_the_start() {
    assert_eq!(Infer::check(&Settings::default(), &at_root()), []);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = context(folder.path());
    let problems = Infer::check(&Settings::default(), &here);
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].key, "model");
    assert!(problems[0].text.contains("models/ground.safetensors"), "{}", problems[0].text);

    std::fs::write(folder.path().join("torn.safetensors"), b"torn").expect("writes");
    let settings = Settings { model: "torn.safetensors".to_owned() };
    let problems = Infer::check(&settings, &here);
    assert!(problems[0].text.contains("torn.safetensors: not a whole safetensors file"), "{}", problems[0].text);
    assert!(Infer::new(&settings, &here).is_err());
}
