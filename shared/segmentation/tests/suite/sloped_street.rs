//! Ground of a synthetic sloped street with the objects on which a height threshold fails.

use crate::support::{GroundConfusion, LabeledCloud, classes_of, model_of, shipped_model};
use ground::Parameters;
use messages::{ClassId, ClassRow};
use random::Random;

const LENGTH_M: f32 = 40.0;
const SENSOR: [f32; 2] = [20.0, 0.0];
/// Centers of parked cars, 4.5 m x 1.8 m x 1.5 m, which occlude the ground behind them.
const CARS: [[f32; 2]; 4] = [[8.0, 2.6], [15.0, 2.6], [26.0, -2.6], [34.0, 2.6]];

/// Height of the street: 8 % along, 2 % across, and a curb of 12 cm at 3.5 m.
fn street_z(x: f32, y: f32) -> f32 {
    0.08 * x + 0.02 * y + if y.abs() > 3.5 { 0.12 } else { 0.0 }
}

fn under_car(x: f32, y: f32) -> bool {
    CARS.iter().any(|car| (x - car[0]).abs() < 2.25 && (y - car[1]).abs() < 0.9)
}

/// Whether a car is between the LiDAR and a position.
fn is_occluded(x: f32, y: f32) -> bool {
    (0..50).any(|i| {
        let share = i as f32 / 50.0;
        under_car(SENSOR[0] + share * (x - SENSOR[0]), SENSOR[1] + share * (y - SENSOR[1]))
    })
}

fn street(seed: u64) -> LabeledCloud {
    let mut random = Random::new(seed);
    let mut cloud = LabeledCloud::default();
    for _ in 0..80_000 {
        let x = random.range(0.0, LENGTH_M);
        let y = random.range(-8.0, 8.0);
        if !under_car(x, y) && !is_occluded(x, y) {
            cloud.push([x, y, street_z(x, y) + random.range(-0.04, 0.04)], Some(true));
        }
    }
    for _ in 0..20_000 {
        let x = random.range(0.0, LENGTH_M);
        let y = if random.unit() < 0.5 { -8.0 } else { 8.0 };
        cloud.push([x, y, street_z(x, y) + random.range(0.0, 9.0)], Some(false));
    }
    for car in CARS {
        for _ in 0..3000 {
            let x = car[0] + random.range(-2.25, 2.25);
            let y = car[1] + random.range(-0.9, 0.9);
            cloud.push([x, y, street_z(x, y) + 1.5], Some(false));
            // The visible side, from the sill up.
            let side = car[1] - 0.9 * car[1].signum();
            cloud.push([x, side, street_z(x, side) + random.range(0.25, 1.5)], Some(false));
        }
    }
    // Reflections below the street.
    for _ in 0..400 {
        let x = random.range(0.0, LENGTH_M);
        let y = random.range(-8.0, 8.0);
        cloud.push([x, y, street_z(x, y) - random.range(0.5, 3.0)], Some(false));
    }
    cloud
}

#[test]
fn ground_of_sloped_street_is_found() {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let cloud = street(1);
    let confusion = GroundConfusion::new(&cloud, &classes_of(model.as_ref(), &cloud.points));
    println!("{confusion:?} accuracy {:.4}", confusion.accuracy());
    assert!(confusion.accuracy() > 0.997, "{confusion:?}");
    assert!(confusion.recall() > 0.995, "{confusion:?}");
    // Labeling all or no points as ground must be far from correct.
    let share = (confusion.true_positives + confusion.false_negatives) as f64 / confusion.n() as f64;
    assert!(share > 0.5 && share < 0.8, "{share}");
}

#[test]
fn only_lowest_centimeters_of_hedge_are_ground() {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let mut cloud = LabeledCloud::default();
    let mut random = Random::new(7);
    for _ in 0..80_000 {
        let x = random.range(0.0, LENGTH_M);
        let y = random.range(-8.0, 8.0);
        cloud.push([x, y, street_z(x, y) + random.range(-0.02, 0.02)], Some(true));
    }
    let first = cloud.points.len();
    // A hedge from the ground up: a tenth of its points is within 10 cm.
    for _ in 0..10_000 {
        let x = random.range(0.0, LENGTH_M);
        let y = random.range(5.0, 5.5);
        cloud.push([x, y, street_z(x, y) + random.range(0.0, 1.0)], Some(false));
    }
    let classes = classes_of(model.as_ref(), &cloud.points);
    let n_ground = |rows: &[ClassRow]| rows.iter().filter(|row| row.class_id == ClassId::Ground as u8).count();
    // The street under the hedge is still found, and so is the curb outside of it, which is higher than the tolerance under a hedge.
    assert!(n_ground(&classes[..first]) > first * 998 / 1000, "{} of {first}", n_ground(&classes[..first]));
    assert!(n_ground(&classes[first..]) < 600, "{} of the hedge", n_ground(&classes[first..]));
}

#[test]
fn isolated_roof_is_not_ground() {
    let mut cloud = street(8);
    let first = cloud.points.len();
    // Eaves 4 m above the street, rising by 10 % to a ridge: a flat zone without walls or ground around it.
    let mut random = Random::new(9);
    for _ in 0..20_000 {
        let x = random.range(10.0, 30.0);
        let y = random.range(14.0, 24.0);
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
    // With the slope of a steep hill it would be ground.
    assert!(n_roof(2.0) > 17_000, "{}", n_roof(2.0));
}

#[test]
fn score_decreases_with_distance_from_terrain() {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let mut cloud = street(2);
    let at = |x: f32, z: f32| [x, 0.05, street_z(x, 0.05) + z];
    let first = cloud.points.len();
    // The last point is in another cell, as an object.
    for (x, z) in [(20.05, 0.0), (20.05, 0.05), (20.05, 0.1), (22.05, 0.6)] {
        cloud.push(at(x, z), None);
    }
    let rows = &classes_of(model.as_ref(), &cloud.points)[first..];
    let scores: Vec<u8> = rows.iter().map(|row| row.score).collect();
    assert!(scores[0] > scores[1] && scores[1] > scores[2] && scores[2] >= 127, "{scores:?}");
    assert_eq!((rows[3].class_id, rows[3].score), (ClassId::Unlabeled as u8, 0));
}

#[test]
fn ground_does_not_depend_on_position_or_order_of_points() {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let mut cloud = street(3);
    let classes = classes_of(model.as_ref(), &cloud.points);
    // A shift by whole cells that f32 represents exactly.
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
fn clouds_without_ground_do_not_fail() {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    assert_eq!(classes_of(model.as_ref(), &[]).len(), 0);
    let mut cloud = LabeledCloud::default();
    for [x, y, z] in [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, f32::NEG_INFINITY], [1.0, 2.0, 3.0]] {
        cloud.push([x, y, z], None);
    }
    // One point is not a zone.
    let classes = classes_of(model.as_ref(), &cloud.points);
    assert_eq!(classes.iter().map(|row| row.class_id).collect::<Vec<_>>(), [ClassId::Unlabeled as u8; 4]);
    // Together with a street they are not ground either.
    let n_invalid = 3;
    cloud.points.truncate(n_invalid);
    cloud.points.extend(street(6).points);
    let classes = classes_of(model.as_ref(), &cloud.points);
    assert!(classes[..n_invalid].iter().all(|row| *row == ClassRow::default()));
    assert!(classes[n_invalid..].iter().any(|row| row.class_id == ClassId::Ground as u8));
}

#[test]
fn outlier_far_away_does_not_change_classes() {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let mut cloud = street(4);
    let classes = classes_of(model.as_ref(), &cloud.points);
    cloud.push([3.0e7, -2.0e7, 5.0], None);
    cloud.push([f32::NAN, 1.0, 5.0], None);
    let with_stray = classes_of(model.as_ref(), &cloud.points);
    assert_eq!(with_stray[..classes.len()], classes);
    assert_eq!(with_stray.len(), classes.len() + 2);
    assert!(with_stray[classes.len()..].iter().all(|row| row.score == 0));
}

#[test]
fn too_large_grid_is_coarsened() {
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
    let input = segmentation::ModelInput::new(&header, &cloud.points);
    let report = model.segment(&input, &mut classes).expect("segments");
    assert_eq!((report.n_unseen, report.coarsened), (0, 8));
    let confusion = GroundConfusion::new(&cloud, &classes);
    assert!(confusion.accuracy() > 0.98, "{confusion:?}");
}
