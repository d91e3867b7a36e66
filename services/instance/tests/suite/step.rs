//! Steps of the stage on the test bench, with streets of known objects.

use crate::support::{CARS, Street, at, bench, send, street};
use instance::{InstanceStage, Settings};
use messages::{ClassHeader, ClassId, ClassRow, ClassTopic, InstanceTopic, SubmapTopic};
use stage::Stage;
use stage::testing::{Bench, context};
use std::path::Path;

/// Ids that a new stage assigns to one submap, and the stage.
fn ids_of(street: &Street, settings: &Settings) -> (Vec<u32>, Bench<InstanceStage>) {
    let mut bench = bench(settings);
    send(&mut bench, street);
    bench.tick().expect("steps");
    let columns = bench.take::<InstanceTopic>();
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
fn cars_and_people_on_a_sloped_street_get_one_id_each() {
    let street = street();
    let (ids, bench) = ids_of(&street, &Settings::default());
    assert_eq!(ids, street.truth);
    assert_eq!(bench.counter("instances"), 5);
    assert!(bench.notes().is_empty(), "{:?}", bench.notes());
}

#[test]
fn larger_dilation_joins_nearby_objects() {
    let mut settings = Settings { dilation_m: 0.4, ..Settings::default() };
    // Otherwise the watershed would split them again.
    settings.things[0].peak_m = 0.0;
    let (ids, bench) = ids_of(&street(), &settings);
    assert_eq!(bench.counter("instances"), 3);
    let of_thing = |thing: u32| ids[street().truth.iter().position(|&t| t == thing).expect("is there")];
    assert_eq!([1, 2, 3, 4, 5].map(of_thing), [1, 1, 2, 3, 3]);
}

#[test]
fn objects_too_high_too_small_or_without_ground_contact_are_removed() {
    let mut street = street();
    let none = street.points.len();
    // A "vehicle" on a balcony, one of 400 points, and one far away where only "building" was observed.
    street.object([10.0, 10.0, 14.0, 12.0], [4.2, 5.5], 3000, ClassId::Vehicles, 0);
    street.object([27.0, 2.0, 28.0, 3.0], [0.2, 1.5], 400, ClassId::Vehicles, 0);
    street.object([60.0, 2.0, 64.0, 4.0], [0.2, 1.5], 3000, ClassId::Vehicles, 0);
    street.object([59.7, 1.7, 64.3, 4.3], [0.2, 1.5], 3000, ClassId::Building, 0);
    let settings = Settings { min_ground_around: 0.1, ..Settings::default() };
    let (ids, bench) = ids_of(&street, &settings);
    assert!(ids == street.truth);
    assert!(ids[none..].iter().all(|&id| id == 0));
    assert_eq!(bench.counter("things_without_ground_around"), 1);
    assert_eq!(ids_of(&street, &Settings::default()).1.counter("instances"), 6);
}

#[test]
fn points_above_the_height_limit_are_removed() {
    let mut street = street();
    let car = street.truth.iter().position(|&thing| thing == 1).expect("is there");
    street.points[car].z += 4.5;
    street.truth[car] = 0;
    assert_eq!(ids_of(&street, &Settings::default()).0, street.truth);
}

#[test]
fn ids_continue_over_submaps_and_restarts() {
    let ids = |restart: bool, settings: &Settings| {
        let mut bench = bench(settings);
        let mut ids = Vec::new();
        for tick in 0..6 {
            // Two ticks in one place, then the drive continues.
            bench.send::<SubmapTopic>(0, at([f64::from(tick / 2) * 100.0, 0.0, 0.0]), street().points);
            bench.send::<ClassTopic>(0, ClassHeader::default(), street().classes);
            bench.tick().expect("steps");
            ids.extend(bench.take::<InstanceTopic>().iter().map(|column| column.rows().to_vec()));
            if restart && tick % 2 == 0 {
                bench = bench.restarted(settings, &context(Path::new("/nowhere"))).expect("restarts");
            }
        }
        ids
    };
    let expected =
        |first: u32| -> Vec<u32> { street().truth.iter().map(|&t| if t == 0 { 0 } else { first + t }).collect() };
    let undisturbed = ids(false, &Settings::default());
    for (tick, ids) in (0..).zip(&undisturbed) {
        assert_eq!(ids, &expected(5 * (tick / 2)));
    }
    assert_eq!(ids(true, &Settings::default()), undisturbed);
    let forgetful = Settings { remembered_submaps: 0, ..Settings::default() };
    for (tick, ids) in (0..).zip(ids(true, &forgetful)) {
        assert_eq!(ids, expected(5 * tick));
    }
}

#[test]
fn late_classes_are_joined_with_their_submap_also_after_a_restart() {
    let settings = Settings::default();
    for restart in [false, true] {
        let mut bench = bench(&settings);
        bench.send::<SubmapTopic>(11, at([0.0; 3]), street().points);
        bench.send::<SubmapTopic>(12, at([0.0; 3]), Vec::new());
        bench.tick().expect("steps");
        assert_eq!(bench.take::<InstanceTopic>().len(), 0);
        if restart {
            bench = bench.restarted(&settings, &context(Path::new("/nowhere"))).expect("restarts");
        }
        bench.send::<ClassTopic>(11, ClassHeader::default(), street().classes);
        bench.tick().expect("steps");
        let columns = bench.take::<InstanceTopic>();
        assert_eq!(columns.iter().map(|c| (c.seq(), c.stamp())).collect::<Vec<_>>(), [(0, 11)]);
        assert_eq!(columns[0].rows(), street().truth);
        // The classes of the second submap are never sent.
        bench.finish().expect("finishes");
        let columns = bench.take::<InstanceTopic>();
        assert_eq!(columns.iter().map(|c| (c.seq(), c.rows().len())).collect::<Vec<_>>(), [(1, 0)]);
        assert_eq!(bench.counter("submaps_without_class"), 1);
    }
}

#[test]
fn wrong_column_length_and_too_many_waiting_submaps_are_errors() {
    let mut bench = bench(&Settings::default());
    bench.send::<SubmapTopic>(0, at([0.0; 3]), street().points);
    bench.send::<ClassTopic>(0, ClassHeader::default(), vec![ClassRow::default(); 7]);
    let error = bench.tick().expect_err("7 rows do not fit").to_string();
    assert!(error.contains("class column of submap 0 has 7 rows"), "{error}");

    let mut bench = self::bench(&Settings::default());
    for _ in 0..3 {
        bench.send::<SubmapTopic>(0, at([0.0; 3]), Vec::new());
    }
    let error = bench.tick().expect_err("three may not wait").to_string();
    assert!(error.contains("3 submaps wait, at most 2 may"), "{error}");
}

#[test]
fn unusual_submaps_are_processed() {
    let settings = Settings::default();
    assert_eq!(ids_of(&Street::default(), &settings).0, [] as [u32; 0]);

    // No ground, only vehicles: found and reported.
    let mut only_cars = Street::default();
    only_cars.object(CARS[0], [0.2, 1.5], 3000, ClassId::Vehicles, 1);
    let (ids, bench) = ids_of(&only_cars, &settings);
    assert_eq!(ids, only_cars.truth);
    assert_eq!(bench.counter("submaps_without_ground"), 1);

    // No objects.
    let road = Street::road(&[]);
    assert_eq!(ids_of(&road, &settings).0, road.truth);

    // Class ids beyond the table, and coordinates that are not finite.
    let mut odd = street();
    odd.classes[0].class_id = 200;
    let first_car = odd.truth.iter().position(|&thing| thing == 1).expect("is there");
    odd.points[first_car].x = f32::NAN;
    odd.points[first_car + 1].z = f32::INFINITY;
    odd.truth[first_car..first_car + 2].fill(0);
    assert_eq!(ids_of(&odd, &settings).0, odd.truth);
}

#[test]
fn objects_far_from_the_origin_are_found() {
    let mut far = street();
    for point in &mut far.points {
        point.x += 16_384.0;
        point.y -= 32_768.0;
    }
    assert_eq!(ids_of(&far, &Settings::default()).0, far.truth);
}

#[test]
fn grid_is_coarsened_or_omitted_for_distant_objects() {
    let mut wide = street();
    wide.push([900.0, 900.0, 0.0], ClassId::Vehicles, 0);
    let (ids, bench) = ids_of(&wide, &Settings::default());
    assert_eq!(bench.counter("submaps_coarsened"), 1);
    assert_eq!(ids.len(), wide.truth.len());
    assert!(ids.iter().zip(&wide.truth).all(|(id, thing)| (*id == 0) == (*thing == 0)));
    wide.push([3.0e8, 0.0, 0.0], ClassId::Vehicles, 0);
    wide.push([0.0, 3.0e8, 0.0], ClassId::Vehicles, 0);
    let (ids, bench) = ids_of(&wide, &Settings::default());
    assert_eq!(ids.len(), wide.truth.len());
    assert!(ids.iter().all(|&id| id == 0));
    assert_eq!(bench.counter("submaps_without_view"), 1);
}

#[test]
fn stage_has_the_name_of_its_folder() {
    assert_eq!(InstanceStage::NAME, "instance");
}
