//! Ground of a made-up street that climbs, with everything that is known to fool a height threshold.

mod support;

use learning::ground::Parameters;
use messages::{ClassId, ClassRow};
use support::{Confusion, LabelledCloud, Random, classes_of, model_of, shipped_model};

const LENGTH_M: f32 = 40.0;
const SENSOR: [f32; 2] = [20.0, 0.0];
/// Centers of parked cars, 4.5 m x 1.8 m x 1.5 m, which throw shadows away from the sensor.
const CARS: [[f32; 2]; 4] = [[8.0, 2.6], [15.0, 2.6], [26.0, -2.6], [34.0, 2.6]];

/// The street's own height: 8 % along, 2 % across, and a kerb of 12 cm at 3.5 m.
fn street_z(x: f32, y: f32) -> f32 {
    0.08 * x + 0.02 * y + if y.abs() > 3.5 { 0.12 } else { 0.0 }
}

fn under_car(x: f32, y: f32) -> bool {
    CARS.iter().any(|car| (x - car[0]).abs() < 2.25 && (y - car[1]).abs() < 0.9)
}

/// Whether a car stands between the sensor and the place.
fn in_shadow(x: f32, y: f32) -> bool {
    (0..50).any(|i| {
        let share = i as f32 / 50.0;
        under_car(SENSOR[0] + share * (x - SENSOR[0]), SENSOR[1] + share * (y - SENSOR[1]))
    })
}

fn street(seed: u64) -> LabelledCloud {
    let mut random = Random(seed);
    let mut cloud = LabelledCloud::default();
    for _ in 0..80_000 {
        let (x, y) = (random.between(0.0, LENGTH_M), random.between(-8.0, 8.0));
        if !under_car(x, y) && !in_shadow(x, y) {
            cloud.push([x, y, street_z(x, y) + random.between(-0.04, 0.04)], Some(true));
        }
    }
    for _ in 0..20_000 {
        let x = random.between(0.0, LENGTH_M);
        let y = if random.uniform() < 0.5 { -8.0 } else { 8.0 };
        cloud.push([x, y, street_z(x, y) + random.between(0.0, 9.0)], Some(false));
    }
    for car in CARS {
        for _ in 0..3000 {
            let (x, y) = (car[0] + random.between(-2.25, 2.25), car[1] + random.between(-0.9, 0.9));
            cloud.push([x, y, street_z(x, y) + 1.5], Some(false));
            // The side that the sensor sees, from the sill up.
            let side = car[1] - 0.9 * car[1].signum();
            cloud.push([x, side, street_z(x, side) + random.between(0.25, 1.5)], Some(false));
        }
    }
    // Reflections below the street.
    for _ in 0..400 {
        let (x, y) = (random.between(0.0, LENGTH_M), random.between(-8.0, 8.0));
        cloud.push([x, y, street_z(x, y) - random.between(0.5, 3.0)], Some(false));
    }
    cloud
}

#[test]
fn ground_of_a_street_that_climbs() {
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    let cloud = street(1);
    let confusion = Confusion::of(&cloud, &classes_of(model.as_ref(), &cloud.points));
    println!("{confusion:?} accuracy {:.4}", confusion.accuracy());
    assert!(confusion.accuracy() > 0.997, "{confusion:?}");
    assert!(confusion.recall() > 0.995, "{confusion:?}");
    // Neither "all is ground" nor "nothing is" comes near.
    let share = (confusion.hits + confusion.misses) as f64 / confusion.n() as f64;
    assert!(share > 0.5 && share < 0.8, "{share}");
}

#[test]
fn of_what_stands_only_the_lowest_centimetres_are_ground() {
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    let mut cloud = LabelledCloud::default();
    let mut random = Random(7);
    for _ in 0..80_000 {
        let (x, y) = (random.between(0.0, LENGTH_M), random.between(-8.0, 8.0));
        cloud.push([x, y, street_z(x, y) + random.between(-0.02, 0.02)], Some(true));
    }
    let first = cloud.points.len();
    // A hedge, from the ground up to its height: a tenth of it is within 10 cm.
    for _ in 0..10_000 {
        let (x, y) = (random.between(0.0, LENGTH_M), random.between(5.0, 5.5));
        cloud.push([x, y, street_z(x, y) + random.between(0.0, 1.0)], Some(false));
    }
    let classes = classes_of(model.as_ref(), &cloud.points);
    let n_ground = |rows: &[ClassRow]| rows.iter().filter(|row| row.class_id == ClassId::Ground as u8).count();
    // Under the hedge the street is still found, and the kerb, which is higher than what is allowed under a hedge, elsewhere.
    assert!(n_ground(&classes[..first]) > first * 998 / 1000, "{} of {first}", n_ground(&classes[..first]));
    assert!(n_ground(&classes[first..]) < 600, "{} of the hedge", n_ground(&classes[first..]));
}

#[test]
fn a_roof_with_nothing_seen_around_it_is_no_ground() {
    let mut cloud = street(8);
    let first = cloud.points.len();
    // Eaves 4 m above the street, which rise by 10 % to a ridge: a flat zone with neither walls nor ground beside it.
    let mut random = Random(9);
    for _ in 0..20_000 {
        let (x, y) = (random.between(10.0, 30.0), random.between(14.0, 24.0));
        cloud.push([x, y, street_z(x, 8.0) + 4.0 + 0.1 * (y - 14.0)], Some(false));
    }
    let n_roof = |slope: f64| {
        let mut parameters = Parameters::default();
        parameters.settings.slope = slope;
        let classes = classes_of(model_of(&parameters).as_ref(), &cloud.points);
        let is_ground = |row: &&ClassRow| row.class_id == ClassId::Ground as u8;
        assert!(classes[..first].iter().filter(is_ground).count() > 50_000);
        classes[first..].iter().filter(is_ground).count()
    };
    assert_eq!(n_roof(Parameters::default().settings.slope), 0);
    // On a hill as steep as that it would be.
    assert!(n_roof(2.0) > 17_000, "{}", n_roof(2.0));
}

#[test]
fn scores_fall_with_the_distance_from_the_terrain() {
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    let mut cloud = street(2);
    let at = |x: f32, z: f32| [x, 0.05, street_z(x, 0.05) + z];
    let first = cloud.points.len();
    // The last in another cell, where it stands.
    for (x, z) in [(20.05, 0.0), (20.05, 0.05), (20.05, 0.1), (22.05, 0.6)] {
        cloud.push(at(x, z), None);
    }
    let rows = &classes_of(model.as_ref(), &cloud.points)[first..];
    let scores: Vec<u8> = rows.iter().map(|row| row.score).collect();
    assert!(scores[0] > scores[1] && scores[1] > scores[2] && scores[2] >= 127, "{scores:?}");
    assert_eq!((rows[3].class_id, rows[3].score), (ClassId::Unlabeled as u8, 0));
}

#[test]
fn the_same_cloud_in_another_place_or_order_has_the_same_ground() {
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    let mut cloud = street(3);
    let classes = classes_of(model.as_ref(), &cloud.points);
    // Whole cells, and numbers that f32 holds exactly beside the street's.
    cloud.points.reverse();
    let mut reversed = classes_of(model.as_ref(), &cloud.points);
    reversed.reverse();
    assert_eq!(reversed, classes);
    cloud.points.reverse();
    for point in &mut cloud.points {
        point.x += 1024.0;
        point.y -= 2048.0;
    }
    let moved = classes_of(model.as_ref(), &cloud.points);
    let n_same = moved.iter().zip(&classes).filter(|(a, b)| a.class_id == b.class_id).count();
    assert!(n_same as f64 > 0.998 * classes.len() as f64, "{n_same} of {}", classes.len());
}

#[test]
fn clouds_without_a_street_do_not_fail() {
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    assert_eq!(classes_of(model.as_ref(), &[]).len(), 0);
    let mut cloud = LabelledCloud::default();
    for [x, y, z] in [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, f32::NEG_INFINITY], [1.0, 2.0, 3.0]] {
        cloud.push([x, y, z], None);
    }
    // One point is no zone.
    assert!(classes_of(model.as_ref(), &cloud.points).iter().all(|row| row.class_id == ClassId::Unlabeled as u8));
    // Beside a street they are not on it either.
    let n_odd = 3;
    cloud.points.truncate(n_odd);
    cloud.points.extend(street(6).points);
    let classes = classes_of(model.as_ref(), &cloud.points);
    assert!(classes[..n_odd].iter().all(|row| *row == ClassRow::default()));
    assert!(classes[n_odd..].iter().any(|row| row.class_id == ClassId::Ground as u8));
}

#[test]
fn a_stray_point_far_away_changes_nothing() {
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    let mut cloud = street(4);
    let classes = classes_of(model.as_ref(), &cloud.points);
    cloud.push([3.0e7, -2.0e7, 5.0], None);
    cloud.push([f32::NAN, 1.0, 5.0], None);
    let with_stray = classes_of(model.as_ref(), &cloud.points);
    assert_eq!(with_stray[..classes.len()], classes);
    assert!(with_stray[classes.len()..].iter().all(|row| row.score == 0));
}

#[test]
fn a_raster_that_would_be_too_large_is_coarsened() {
    let mut parameters = Parameters::default();
    parameters.settings.cell_m = 0.02;
    parameters.settings.reach_m = 500.0;
    parameters.steps_m = (1..=150).map(|gap| 0.08 + 0.15 * 0.02 * gap as f32).collect();
    let model = model_of(&parameters);
    let mut cloud = street(5);
    for corner in [[-300.0, -300.0, 0.0], [320.0, 300.0, 0.0]] {
        cloud.push(corner, None);
    }
    let header = messages::SubmapHeader::default();
    let mut classes = vec![messages::ClassRow::default(); cloud.points.len()];
    let seen = learning::Cloud { header: &header, points: &cloud.points, colors: None };
    let report = model.segment(&seen, &mut classes).expect("segments");
    assert_eq!((report.n_unseen, report.coarsened), (0, 8));
    let confusion = Confusion::of(&cloud, &classes);
    assert!(confusion.accuracy() > 0.98, "{confusion:?}");
}
