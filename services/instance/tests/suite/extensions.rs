//! Extensions of the algorithm of the thesis: tracking, separation in time, splitting and joining.

use crate::support::{PEOPLE, Street, bench, slope};
use instance::{InstanceStage, Settings, Thing};
use messages::{ClassHeader, ClassId, ClassTopic, InstanceTopic, PoseRow, SubmapHeader, SubmapTopic};
use stage::parse_table;
use stage::testing::Bench;

/// Pose of a submap at the origin of odom.
const HERE: PoseRow = PoseRow { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };

/// Ids of consecutive submaps with their poses.
fn ids_of(submaps: &[(PoseRow, &Street)], settings: &Settings) -> Vec<Vec<u32>> {
    ids_of_bench(&mut bench(settings), submaps)
}

fn ids_of_bench(bench: &mut Bench<InstanceStage>, submaps: &[(PoseRow, &Street)]) -> Vec<Vec<u32>> {
    let mut ids = Vec::new();
    for &(odom_from_submap, street) in submaps {
        let header = SubmapHeader { odom_from_submap, ..SubmapHeader::default() };
        bench.send::<SubmapTopic>(0, header, street.points.clone());
        bench.send::<ClassTopic>(0, ClassHeader::default(), street.classes.clone());
        bench.tick().expect("steps");
        ids.extend(bench.take::<InstanceTopic>().iter().map(|column| column.rows().to_vec()));
    }
    ids
}

/// Distinct ids of the points of an object.
fn ids_of_thing(ids: &[u32], street: &Street, thing: u32) -> Vec<u32> {
    let mut of_thing: Vec<u32> =
        ids.iter().zip(&street.truth).filter(|(_, t)| **t == thing).map(|(id, _)| *id).collect();
    of_thing.sort_unstable();
    of_thing.dedup();
    of_thing
}

fn with_first_thing(change: impl FnOnce(&mut Thing)) -> Settings {
    let mut settings = Settings::default();
    change(&mut settings.things[0]);
    settings
}

const CAR: [f32; 4] = [20.0, 4.0, 24.2, 5.8];

/// A road with one car of `n` points.
fn one_car(n: usize) -> Street {
    let mut street = Street::road(&[CAR]);
    street.object(CAR, [0.2, 1.5], n, ClassId::Vehicles, 1);
    street
}

#[test]
fn car_at_a_submap_border_keeps_its_id_even_with_few_points() {
    // The second submap is 15 m further and rotated by 90 degrees: its point (x', y') is (15 - y', x') in odom.
    let near = one_car(3000);
    let mut far = Street::default();
    let mut behind = one_car(490);
    for (point, (class, truth)) in behind.points.drain(..).zip(behind.classes.iter().zip(&behind.truth)) {
        far.points.push(messages::SubmapPoint { x: point.y, y: 15.0 - point.x, ..point });
        far.classes.push(*class);
        far.truth.push(*truth);
    }
    let half = 0.5_f64.sqrt();
    let odom_from_far = PoseRow { translation: [15.0, 0.0, 0.0], rotation: [0.0, 0.0, half, half] };
    // A point (y, 15 - x) rotated by 90 degrees and moved is (x, y).
    let ids = ids_of(&[(HERE, &near), (odom_from_far, &far)], &Settings::default());
    assert_eq!(ids_of_thing(&ids[0], &near, 1), [1]);
    assert_eq!(ids_of_thing(&ids[1], &far, 1), [1]);

    let forgetful = Settings { remembered_submaps: 0, ..Settings::default() };
    let ids = ids_of(&[(HERE, &near), (odom_from_far, &far)], &forgetful);
    assert_eq!(ids_of_thing(&ids[1], &far, 1), [0], "490 points are too few for a new vehicle");
}

#[test]
fn unobserved_object_keeps_its_id_for_the_configured_number_of_submaps() {
    let car = one_car(3000);
    let none = Street::road(&[]);
    let settings = Settings { remembered_submaps: 2, ..Settings::default() };
    for (n_between, expected) in [(0, 1), (1, 1), (2, 2)] {
        let mut submaps = vec![(HERE, &car)];
        submaps.extend((0..n_between).map(|_| (HERE, &none)));
        submaps.push((HERE, &car));
        let ids = ids_of(&submaps, &settings);
        assert_eq!(ids_of_thing(&ids[n_between + 1], &car, 1), [expected], "{n_between} between");
    }
}

/// A road with passing cars: every 0.1 s each car adds a box of points and moves by `step_m`.
fn passing(cars: &[(f32, f32)], step_m: f32) -> Street {
    let mut street = Street::road(&[]);
    for (number, &(begin_s, y)) in (1..).zip(cars) {
        for i in 0..15 {
            let first = street.points.len();
            let x = 3.0 + i as f32 * step_m;
            street.object([x, y, x + 4.2, y + 1.8], [0.2, 1.5], 3000, ClassId::Vehicles, number);
            let offset_nanos = ((begin_s + i as f32 * 0.1) * 1e9) as u32;
            street.points[first..].iter_mut().for_each(|point| point.offset_nanos = offset_nanos);
        }
    }
    // Sorted by time, as in a submap.
    let mut order: Vec<usize> = (0..street.points.len()).collect();
    order.sort_by_key(|&i| street.points[i].offset_nanos);
    Street {
        points: order.iter().map(|&i| street.points[i]).collect(),
        classes: order.iter().map(|&i| street.classes[i]).collect(),
        truth: order.iter().map(|&i| street.truth[i]).collect(),
    }
}

#[test]
fn cars_passing_one_place_one_after_the_other_are_two_instances() {
    let street = passing(&[(0.0, 5.0), (2.2, 5.1)], 0.9);
    let ids = &ids_of(&[(HERE, &street)], &Settings::default())[0];
    let first = ids_of_thing(ids, &street, 1);
    let second = ids_of_thing(ids, &street, 2);
    assert_eq!((first.len(), second.len()), (1, 1), "{first:?} {second:?}");
    assert_ne!(first, second);
    let timeless = Settings { apart_s: 0.0, ..Settings::default() };
    let ids = &ids_of(&[(HERE, &street)], &timeless)[0];
    assert_eq!(ids_of_thing(ids, &street, 1), ids_of_thing(ids, &street, 2));
}

#[test]
fn parked_car_that_was_occluded_for_a_while_is_one_instance() {
    let street = passing(&[(0.0, 5.0), (2.2, 5.0)], 0.0);
    let ids = &ids_of(&[(HERE, &street)], &Settings::default())[0];
    assert_eq!(ids_of_thing(ids, &street, 1), [1]);
    assert_eq!(ids_of_thing(ids, &street, 2), [1]);
}

#[test]
fn moving_car_keeps_its_id_over_the_border_and_the_next_car_gets_a_new_id() {
    let first = passing(&[(0.0, 5.0)], 0.9);
    let mut second = passing(&[(1.5, 5.0), (2.8, 5.0)], 0.9);
    // The first car continues at its position; the second follows the whole path of the first.
    for (point, _) in second.points.iter_mut().zip(&second.truth).filter(|(_, thing)| **thing == 1) {
        point.x += 13.0;
        point.z += slope(13.0);
    }
    let ids = ids_of(&[(HERE, &first), (HERE, &second)], &Settings::default());
    assert_eq!(ids_of_thing(&ids[0], &first, 1), [1]);
    assert_eq!(ids_of_thing(&ids[1], &second, 1), [1]);
    assert_eq!(ids_of_thing(&ids[1], &second, 2), [2]);
}

/// Two cars bumper to bumper, 20 cm apart: bodies and cabins.
fn bumper_to_bumper() -> Street {
    let bodies = [[5.0, 4.0, 9.2, 5.8], [9.4, 4.0, 13.6, 5.8]];
    let mut street = Street::road(&bodies);
    for (number, [x0, y0, x1, y1]) in (1..).zip(bodies) {
        street.object([x0, y0, x1, y1], [0.2, 0.8], 6500, ClassId::Vehicles, number);
        street.object([x0 + 1.2, y0 + 0.2, x1 - 1.0, y1 - 0.2], [0.8, 1.5], 6500, ClassId::Vehicles, number);
    }
    street
}

#[test]
fn cars_bumper_to_bumper_are_split_between_their_roofs() {
    let street = bumper_to_bumper();
    let joined = &ids_of(&[(HERE, &street)], &with_first_thing(|thing| thing.peak_m = 0.0))[0];
    assert_eq!(ids_of_thing(joined, &street, 1), ids_of_thing(joined, &street, 2));
    let ids = &ids_of(&[(HERE, &street)], &with_first_thing(|thing| thing.peak_m = 0.4))[0];
    let n_wrong = ids.iter().zip(&street.truth).filter(|(id, truth)| id != truth).count();
    assert!(n_wrong < 260, "{n_wrong} of 26 000 points have the id of the other car, or none");
}

#[test]
fn parts_of_a_van_are_joined_unless_too_long_or_with_ground_between() {
    let halves = [[5.0, 4.0, 7.2, 5.8], [7.9, 4.0, 10.0, 5.8]];
    let street = |holes: &[[f32; 4]]| {
        let mut street = Street::road(holes);
        for half in halves {
            street.object(half, [0.2, 2.2], 2000, ClassId::Vehicles, 1);
        }
        street
    };
    let join =
        |join_m: f64, length_m: f64| with_first_thing(|thing| (thing.join_m, thing.max_length_m) = (join_m, length_m));
    let ids = |street: &Street, settings: &Settings| ids_of_thing(&ids_of(&[(HERE, street)], settings)[0], street, 1);
    let hidden = street(&[[5.0, 4.0, 10.0, 5.8]]);
    assert_eq!(ids(&hidden, &join(0.0, 0.0)), [1, 2]);
    assert_eq!(ids(&hidden, &join(0.8, 6.0)), [1]);
    assert_eq!(ids(&hidden, &join(0.8, 4.5)), [1, 2], "together they are 5 m long");
    assert_eq!(ids(&street(&halves), &join(0.8, 6.0)), [1, 2], "the road between them was seen");
}

#[test]
fn pedestrians_with_low_score_are_removed() {
    let mut street = Street::road(&PEOPLE);
    for (number, person) in (1..).zip(PEOPLE) {
        street.object(person, [0.0, 1.8], 300, ClassId::Pedestrian, number);
    }
    // 0.59 of the first, 0.61 of the second.
    for (row, truth) in street.classes.iter_mut().zip(&street.truth) {
        row.score = [255, 150, 156][*truth as usize];
    }
    let mut bench = bench(&Settings::default());
    let ids = &ids_of_bench(&mut bench, &[(HERE, &street)])[0];
    assert_eq!((ids_of_thing(ids, &street, 1), ids_of_thing(ids, &street, 2)), (vec![0], vec![1]));
    assert_eq!(bench.counter("things_below_min_score"), 1);
    let mut trusting = Settings::default();
    trusting.things[1].min_score = 0.0;
    assert_eq!(ids_of(&[(HERE, &street)], &trusting)[0], street.truth);
}

#[test]
fn any_class_can_have_instances() {
    let mut street = Street::road(&[]);
    for (number, x) in [(1, 5.0), (2, 8.0)] {
        street.object([x, 4.0, x + 0.3, 4.3], [0.0, 6.0], 400, ClassId::Pole, number);
    }
    let table =
        stage::toml::de::DeTable::parse("things = [{ class = \"pole\", max_height_m = 12.0, min_points = 50 }]")
            .expect("parses");
    let (settings, problems) = parse_table::<Settings>(table.get_ref());
    assert_eq!(problems, []);
    assert_eq!(ids_of(&[(HERE, &street)], &settings)[0], street.truth);
}

#[test]
fn invalid_things_are_refused() {
    for entry in [
        "class = \"poles\", max_height_m = 12.0, min_points = 50",
        "class = \"unlabeled\", max_height_m = 12.0, min_points = 50",
        "class = \"pole\", max_height_m = 0.0, min_points = 50",
        "class = \"pole\", max_height_m = 12.0, min_points = 0",
        "class = \"pole\", max_height_m = 12.0, min_points = 50, min_score = 1.5",
        "class = \"pole\", max_height_m = 12.0, min_points = 50, joins_m = 1.0",
        "class = \"pole\", max_height_m = 12.0",
    ] {
        let text = format!("things = [{{ {entry} }}]");
        let table = stage::toml::de::DeTable::parse(&text).expect("parses");
        let (_, problems) = parse_table::<Settings>(table.get_ref());
        assert_eq!(problems.len(), 1, "{entry}");
        assert_eq!(problems[0].key, "things", "{entry}");
    }
}
