//! The stage on the bench, on streets whose things are known.

use instance::{InstanceStage, Settings};
use messages::{Class, ClassHeader, ClassId, ClassRow, Instance, Submap, SubmapHeader, SubmapPoint};
use stage::Stage;
use stage::testing::{Bench, context};
use std::path::Path;

/// Points, their classes and the number of the thing that each belongs to, 0 for none.
#[derive(Clone, Default)]
struct Street {
    points: Vec<SubmapPoint>,
    classes: Vec<ClassRow>,
    truth: Vec<u32>,
}

impl Street {
    fn push(&mut self, [x, y, z]: [f32; 3], class: ClassId, thing: u32) {
        self.points.push(SubmapPoint { x, y, z, ..SubmapPoint::default() });
        self.classes.push(ClassRow { class_id: class as u8, score: 255 });
        self.truth.push(thing);
    }

    /// 30 m x 14 m of road that climbs by 10 %, one point every 10 cm, none under the boxes of `holes`.
    fn road(holes: &[[f32; 4]]) -> Self {
        let mut street = Self::default();
        for (row, col) in (0..300_u16).flat_map(|row| (0..140_u16).map(move |col| (row, col))) {
            let (x, y) = (f32::from(row) * 0.1 + 0.05, f32::from(col) * 0.1 + 0.05);
            if !holes.iter().any(|&[x0, y0, x1, y1]| x > x0 && x < x1 && y > y0 && y < y1) {
                street.push([x, y, slope(x)], ClassId::Road, 0);
            }
        }
        street
    }

    /// The outline of a box as a lidar sees it: points on a spiral of 50 rounds up its sides.
    fn object(&mut self, [x0, y0, x1, y1]: [f32; 4], heights: [f32; 2], n: usize, class: ClassId, thing: u32) {
        let perimeter = 2.0 * (x1 - x0 + y1 - y0);
        for i in 0..n {
            let share = i as f32 / n as f32;
            let along = (share * 50.0).fract() * perimeter;
            let (dx, dy) = (x1 - x0, y1 - y0);
            let (x, y) = match along {
                a if a < dx => (x0 + a, y0),
                a if a < dx + dy => (x1, y0 + a - dx),
                a if a < 2.0 * dx + dy => (x1 - (a - dx - dy), y1),
                a => (x0, y1 - (a - 2.0 * dx - dy)),
            };
            let above = heights[0] + share * (heights[1] - heights[0]);
            self.push([x, y, slope(x) + above], class, thing);
        }
    }
}

fn slope(x: f32) -> f32 {
    0.1 * x
}

const CARS: [[f32; 4]; 3] = [[2.0, 2.0, 6.4, 3.8], [7.0, 2.0, 11.4, 3.8], [20.0, 9.0, 24.4, 10.8]];
const PEOPLE: [[f32; 4]; 2] = [[14.0, 6.0, 14.5, 6.5], [15.2, 6.0, 15.7, 6.5]];

/// Three cars, two of them 60 cm apart, and two people 70 cm apart.
fn street() -> Street {
    let mut street = Street::road(&[CARS, [PEOPLE[0], PEOPLE[1], CARS[0]]].concat());
    for (number, car) in (1..).zip(CARS) {
        street.object(car, [0.2, 1.5], 3000, ClassId::Vehicles, number);
    }
    for (number, person) in (4..).zip(PEOPLE) {
        street.object(person, [0.0, 1.8], 300, ClassId::Pedestrian, number);
    }
    street
}

fn bench(settings: &Settings) -> Bench<InstanceStage> {
    Bench::new(settings, &context(Path::new("/nowhere"))).expect("builds")
}

fn send(bench: &mut Bench<InstanceStage>, street: &Street) {
    bench.send::<Submap>(0, SubmapHeader::default(), street.points.clone());
    bench.send::<Class>(0, ClassHeader::default(), street.classes.clone());
}

/// Ids of one submap through a new stage, and that stage.
fn ids_of(street: &Street, settings: &Settings) -> (Vec<u32>, Bench<InstanceStage>) {
    let mut bench = bench(settings);
    send(&mut bench, street);
    bench.tick().expect("steps");
    let columns = bench.take::<Instance>();
    assert_eq!(columns.len(), 1);
    let ids = columns[0].rows().to_vec();
    let n_points = ids.iter().filter(|&&id| id != 0).count();
    assert_eq!(columns[0].header().n_points as usize, n_points);
    let mut distinct: Vec<u32> = ids.iter().copied().filter(|&id| id != 0).collect();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(columns[0].header().n_instances as usize, distinct.len());
    (ids, bench)
}

#[test]
fn cars_and_people_get_a_number_each_on_a_street_that_climbs() {
    let street = street();
    let (ids, bench) = ids_of(&street, &Settings::default());
    assert_eq!(ids, street.truth);
    assert_eq!(bench.counter("instances"), 5);
    assert!(bench.notes().is_empty(), "{:?}", bench.notes());
}

#[test]
fn a_wider_dilation_joins_what_stands_close() {
    let settings = Settings { dilation_m: 0.4, ..Settings::default() };
    let (ids, bench) = ids_of(&street(), &settings);
    assert_eq!(bench.counter("instances"), 3);
    let of_thing = |thing: u32| ids[street().truth.iter().position(|&t| t == thing).expect("is there")];
    assert_eq!([1, 2, 3, 4, 5].map(of_thing), [1, 1, 2, 3, 3]);
}

#[test]
fn what_is_too_high_too_small_or_afloat_is_none() {
    let mut street = street();
    let none = street.points.len();
    // A "vehicle" on a balcony, one of 400 points, and one far out where nothing but "building" was seen.
    street.object([10.0, 10.0, 14.0, 12.0], [4.2, 5.5], 3000, ClassId::Vehicles, 0);
    street.object([27.0, 2.0, 28.0, 3.0], [0.2, 1.5], 400, ClassId::Vehicles, 0);
    street.object([60.0, 2.0, 64.0, 4.0], [0.2, 1.5], 3000, ClassId::Vehicles, 0);
    street.object([59.7, 1.7, 64.3, 4.3], [0.2, 1.5], 3000, ClassId::Building, 0);
    let (ids, bench) = ids_of(&street, &Settings::default());
    assert_eq!(ids, street.truth);
    assert!(ids[none..].iter().all(|&id| id == 0));
    assert_eq!(bench.counter("things_without_ground_around"), 1);
    let settings = Settings { min_ground_around: 0.0, ..Settings::default() };
    assert_eq!(ids_of(&street, &settings).1.counter("instances"), 6);
}

#[test]
fn the_roof_rack_above_the_limit_is_cut_off() {
    let mut street = street();
    let car = street.truth.iter().position(|&thing| thing == 1).expect("is there");
    street.points[car].z += 4.5;
    street.truth[car] = 0;
    assert_eq!(ids_of(&street, &Settings::default()).0, street.truth);
}

#[test]
fn ids_go_on_from_submap_to_submap_also_over_a_restart() {
    let ids = |restart: bool| {
        let settings = Settings::default();
        let mut bench = bench(&settings);
        let mut ids = Vec::new();
        for tick in 0..4 {
            send(&mut bench, &street());
            bench.tick().expect("steps");
            ids.extend(bench.take::<Instance>().iter().map(|column| column.rows().to_vec()));
            if restart && tick == 1 {
                bench = bench.restarted(&settings, &context(Path::new("/nowhere"))).expect("restarts");
            }
        }
        ids
    };
    let undisturbed = ids(false);
    for (submap, ids) in (0..).zip(&undisturbed) {
        let expected: Vec<u32> = street().truth.iter().map(|&t| if t == 0 { 0 } else { 5 * submap + t }).collect();
        assert_eq!(ids, &expected);
    }
    assert_eq!(ids(true), undisturbed);
}

#[test]
fn classes_that_come_later_find_their_submap_also_over_a_restart() {
    let settings = Settings::default();
    for restart in [false, true] {
        let mut bench = bench(&settings);
        bench.send::<Submap>(11, SubmapHeader::default(), street().points);
        bench.send::<Submap>(12, SubmapHeader::default(), Vec::new());
        bench.tick().expect("steps");
        assert_eq!(bench.take::<Instance>().len(), 0);
        if restart {
            bench = bench.restarted(&settings, &context(Path::new("/nowhere"))).expect("restarts");
        }
        bench.send::<Class>(11, ClassHeader::default(), street().classes);
        bench.tick().expect("steps");
        let columns = bench.take::<Instance>();
        assert_eq!(columns.iter().map(|c| (c.seq(), c.stamp())).collect::<Vec<_>>(), [(0, 11)]);
        assert_eq!(columns[0].rows(), street().truth);
        // The second's classes never come.
        bench.finish().expect("finishes");
        let columns = bench.take::<Instance>();
        assert_eq!(columns.iter().map(|c| (c.seq(), c.rows().len())).collect::<Vec<_>>(), [(1, 0)]);
        assert_eq!(bench.counter("submaps_without_class"), 1);
    }
}

#[test]
fn columns_of_wrong_length_or_too_many_waiting_submaps_are_errors() {
    let mut bench = bench(&Settings::default());
    bench.send::<Submap>(0, SubmapHeader::default(), street().points);
    bench.send::<Class>(0, ClassHeader::default(), vec![ClassRow::default(); 7]);
    let error = bench.tick().expect_err("7 rows do not fit").to_string();
    assert!(error.contains("class column of submap 0 has 7 rows"), "{error}");

    let mut bench = self::bench(&Settings::default());
    for _ in 0..3 {
        bench.send::<Submap>(0, SubmapHeader::default(), Vec::new());
    }
    let error = bench.tick().expect_err("three may not wait").to_string();
    assert!(error.contains("3 messages of submap wait"), "{error}");
}

#[test]
fn odd_submaps_pass() {
    let settings = Settings::default();
    assert_eq!(ids_of(&Street::default(), &settings).0, [] as [u32; 0]);

    // No ground at all, only vehicles: found, and said.
    let mut only_cars = Street::default();
    only_cars.object(CARS[0], [0.2, 1.5], 3000, ClassId::Vehicles, 1);
    let (ids, bench) = ids_of(&only_cars, &settings);
    assert_eq!(ids, only_cars.truth);
    assert_eq!(bench.counter("submaps_without_ground"), 1);

    // No things.
    let road = Street::road(&[]);
    assert_eq!(ids_of(&road, &settings).0, road.truth);

    // Class ids past the table, and coordinates that are no numbers.
    let mut odd = street();
    odd.classes[0].class_id = 200;
    let first_car = odd.truth.iter().position(|&thing| thing == 1).expect("is there");
    odd.points[first_car].x = f32::NAN;
    odd.points[first_car + 1].z = f32::INFINITY;
    odd.truth[first_car..first_car + 2].fill(0);
    assert_eq!(ids_of(&odd, &settings).0, odd.truth);
}

#[test]
fn far_from_the_origin_the_same_things_are_found() {
    let mut far = street();
    for point in &mut far.points {
        point.x += 16_384.0;
        point.y -= 32_768.0;
    }
    assert_eq!(ids_of(&far, &Settings::default()).0, far.truth);
}

#[test]
fn things_too_far_apart_for_the_grid_are_coarsened_or_given_up() {
    let mut wide = street();
    wide.push([900.0, 900.0, 0.0], ClassId::Vehicles, 0);
    let (ids, bench) = ids_of(&wide, &Settings::default());
    assert_eq!(bench.counter("submaps_coarsened"), 1);
    assert!(ids.iter().zip(&wide.truth).all(|(id, thing)| (*id == 0) == (*thing == 0)));
    wide.push([3.0e8, 0.0, 0.0], ClassId::Vehicles, 0);
    wide.push([0.0, 3.0e8, 0.0], ClassId::Vehicles, 0);
    let (ids, bench) = ids_of(&wide, &Settings::default());
    assert!(ids.iter().all(|&id| id == 0));
    assert_eq!(bench.counter("submaps_without_view"), 1);
}

#[test]
fn the_stage_is_called_as_its_folder() {
    assert_eq!(InstanceStage::NAME, "instance");
}
