//! Steps of the stage without processes.

use height_segmenter::{HeightSegmenter, Settings};
use stage::messages::{CLASS_TABLE_VERSION, ClassId, ClassTopic, SubmapHeader, SubmapPoint, SubmapTopic};
use stage::testing::{Bench, context};
use stage::{Context, Stage};
use std::path::Path;

fn nowhere() -> Context {
    context(Path::new("/nowhere"))
}

/// A street of 30 m x 16 m that climbs by 6 %, with a car, a hedge of 20 m, a house front and the crown of a tree.
fn street() -> (Vec<SubmapPoint>, Vec<ClassId>) {
    let mut points = Vec::new();
    let mut truth = Vec::new();
    let mut fill = |x: [f32; 2], y: [f32; 2], z: [f32; 2], class: ClassId| {
        let steps = |[low, high]: [f32; 2]| {
            let n = ((high - low) / 0.2).round() as u16;
            (0..=n).map(move |i| low + f32::from(i) * 0.2)
        };
        for x in steps(x) {
            for y in steps(y) {
                for above in steps(z) {
                    points.push(SubmapPoint { x, y, z: 0.06 * x + above, ..SubmapPoint::default() });
                    truth.push(class);
                }
            }
        }
    };
    fill([0.1, 29.9], [0.1, 15.9], [0.0, 0.0], ClassId::Ground);
    fill([8.1, 12.1], [3.1, 4.7], [0.6, 1.4], ClassId::Vehicles);
    fill([5.1, 25.1], [11.1, 11.5], [0.6, 1.2], ClassId::Unlabeled);
    fill([0.1, 29.9], [15.9, 15.9], [0.6, 8.0], ClassId::Building);
    fill([18.1, 21.1], [6.1, 9.1], [3.2, 5.0], ClassId::Vegetation);
    (points, truth)
}

#[test]
fn street_is_classified_by_heights() {
    let mut bench = Bench::<HeightSegmenter>::new(&Settings::default(), &nowhere()).expect("builds");
    let (points, truth) = street();
    bench.send::<SubmapTopic>(5, SubmapHeader::default(), points);
    bench.send::<SubmapTopic>(6, SubmapHeader::default(), Vec::new());
    bench.tick().expect("steps");
    let columns = bench.take::<ClassTopic>();
    assert_eq!(
        columns.iter().map(|c| (c.seq(), c.stamp(), c.rows().len())).collect::<Vec<_>>(),
        [(0, 5, truth.len()), (1, 6, 0)]
    );
    assert_eq!(columns[0].header().class_table_version, CLASS_TABLE_VERSION);
    for class in [ClassId::Ground, ClassId::Vehicles, ClassId::Unlabeled, ClassId::Building, ClassId::Vegetation] {
        let rows = columns[0].rows().iter().zip(&truth).filter(|(_, truth)| **truth == class);
        let (n, hits) = rows.fold((0, 0), |(n, hits), (row, _)| (n + 1, hits + u32::from(row.class_id == class as u8)));
        assert!(f64::from(hits) > 0.97 * f64::from(n), "{}: {hits} of {n}", class.name());
    }
}

#[test]
fn car_outside_of_street_is_no_vehicle() {
    let (points, truth) = street();
    let mut header = SubmapHeader { n_sweeps: 1, ..SubmapHeader::default() };
    header.sweeps[0].submap_from_lidar_begin = [60.0, 4.0, 2.0, 0.0, 0.0, 0.0, 1.0];
    let mut bench = Bench::<HeightSegmenter>::new(&Settings::default(), &nowhere()).expect("builds");
    bench.send::<SubmapTopic>(0, header, points);
    bench.tick().expect("steps");
    let columns = bench.take::<ClassTopic>();
    let rows = columns[0].rows();
    assert_eq!(rows.len(), truth.len());
    assert!(rows.iter().all(|row| row.class_id != ClassId::Vehicles as u8));
    assert!(rows.iter().zip(&truth).any(|(row, truth)| row.class_id == *truth as u8));
}

#[test]
fn points_with_invalid_coordinates_stay_unlabeled() {
    let (mut points, _) = street();
    points[0].x = f32::NAN;
    points[1].y = f32::INFINITY;
    points[2].z = f32::NEG_INFINITY;
    points[3].x = -3.0e38;
    let mut bench = Bench::<HeightSegmenter>::new(&Settings::default(), &nowhere()).expect("builds");
    bench.send::<SubmapTopic>(0, SubmapHeader::default(), points);
    bench.tick().expect("steps");
    let columns = bench.take::<ClassTopic>();
    assert!(columns[0].rows()[..4].iter().all(|row| (row.class_id, row.score) == (0, 0)));
    assert!(columns[0].rows()[4..].iter().any(|row| row.class_id == ClassId::Ground as u8));
}

#[test]
fn restart_in_mid_stream_changes_nothing() {
    let columns = |restart: bool| {
        let mut bench = Bench::<HeightSegmenter>::new(&Settings::default(), &nowhere()).expect("builds");
        let mut columns = Vec::new();
        for n_cut in 0..3 {
            let (mut points, _) = street();
            points.truncate(points.len() - 500 * n_cut);
            bench.send::<SubmapTopic>(0, SubmapHeader::default(), points);
            bench.tick().expect("steps");
            columns.extend(bench.take::<ClassTopic>().iter().map(|column| (column.seq(), column.rows().to_vec())));
            if restart && n_cut == 1 {
                bench = bench.restarted(&Settings::default(), &nowhere()).expect("restarts");
            }
        }
        columns
    };
    let uninterrupted = columns(false);
    assert_eq!(uninterrupted.len(), 3);
    assert!(columns(true) == uninterrupted);
}

#[test]
fn stage_has_name_and_topics_of_infer() {
    assert_eq!(HeightSegmenter::NAME, "infer");
    let topics = |ports: Vec<stage::Port>| ports.iter().map(stage::Port::topic).collect::<Vec<_>>();
    assert_eq!(topics(HeightSegmenter::inputs()), ["submap"]);
    assert_eq!(topics(HeightSegmenter::outputs()), ["class"]);
}
