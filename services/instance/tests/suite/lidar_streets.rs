//! Objects on streets as scanned by a LiDAR: sparse, moving and partly occluded.

use crate::support::bench;
use crate::support::lidar::{Block, HDL32, HDL64, SWEEP_NANOS, Scan, car};
use instance::{Settings, Thing};
use messages::{ClassHeader, ClassId, ClassTopic, InstanceTopic, SubmapTopic};
use stage::Received;
use std::collections::BTreeSet;

/// Instance column of each of consecutive submaps.
fn columns_of(scans: &[&Scan], settings: &Settings) -> Vec<Received<InstanceTopic>> {
    let mut bench = bench(settings);
    let mut columns = Vec::new();
    for scan in scans {
        bench.send::<SubmapTopic>(0, *scan.header, scan.street.points.clone());
        bench.send::<ClassTopic>(0, ClassHeader::default(), scan.street.classes.clone());
        bench.tick().expect("steps");
        columns.extend(bench.take::<InstanceTopic>());
    }
    columns
}

/// Ids of the points of consecutive submaps.
fn ids_of(scans: &[&Scan], settings: &Settings) -> Vec<Vec<u32>> {
    columns_of(scans, settings).iter().map(|column| column.rows().to_vec()).collect()
}

/// Distinct ids of the points of an object; 0 is left out if less than a tenth of the points have it.
fn ids_of_thing(ids: &[u32], scan: &Scan, thing: u32) -> Vec<u32> {
    let of_thing: Vec<u32> =
        ids.iter().zip(&scan.street.truth).filter(|(_, t)| **t == thing).map(|(id, _)| *id).collect();
    let n_none = of_thing.iter().filter(|id| **id == 0).count();
    assert!(!of_thing.is_empty(), "object {thing} was not seen");
    let distinct: BTreeSet<u32> =
        of_thing.iter().copied().filter(|&id| id != 0 || 10 * n_none > of_thing.len()).collect();
    distinct.into_iter().collect()
}

fn with_vehicles(change: impl FnOnce(&mut Thing)) -> Settings {
    let mut settings = Settings::default();
    change(&mut settings.things[0]);
    settings
}

#[test]
fn sparse_car_at_25_m_is_found_in_one_sweep() {
    for lidar in [HDL64, HDL32] {
        let mut scan = Scan::new(lidar);
        scan.sweep(lidar, [0.0; 2], 0, &car([25.0, -0.9], 1));
        let n_points = scan.street.truth.iter().filter(|thing| **thing == 1).count();
        assert!((20..500).contains(&n_points), "{n_points} points");
        assert_eq!(ids_of_thing(&ids_of(&[&scan], &Settings::default())[0], &scan, 1), [1], "{n_points} points");
        let of_thesis = with_vehicles(|thing| thing.min_share = 0.0);
        assert_eq!(ids_of_thing(&ids_of(&[&scan], &of_thesis)[0], &scan, 1), [0]);
    }
}

#[test]
fn sparse_car_of_a_lidar_without_rings_is_found() {
    let mut scan = Scan::new(HDL64);
    scan.sweep(HDL64, [0.0; 2], 0, &car([25.0, -0.9], 1));
    scan.header.n_rings = 0;
    for point in &mut scan.street.points {
        point.ring = 0;
        point.azimuth = ((point.y.atan2(point.x).to_degrees().rem_euclid(360.0) * 100.0) as u16).min(35_999);
    }
    let ids = &ids_of(&[&scan], &Settings::default())[0];
    assert_eq!(ids_of_thing(ids, &scan, 1), [1]);
    // Few points at 5 m belong to no object.
    let mut near = scan;
    near.street.object([4.0, 6.0, 4.6, 6.4], [0.3, 0.9], 25, ClassId::Vehicles, 2);
    near.header.sweeps[0].n_points += 25;
    assert_eq!(ids_of_thing(&ids_of(&[&near], &Settings::default())[0], &near, 2), [0]);
}

#[test]
fn few_points_of_many_near_sweeps_are_no_object() {
    let mut scan = Scan::new(HDL32);
    for idx in 0..20_u8 {
        let x = f32::from(idx) * 0.8;
        scan.sweep(HDL32, [x, 0.0], i64::from(idx) * SWEEP_NANOS, &[]);
    }
    // Forty points 5 m from the path: a car has thousands of points there.
    scan.street.object([8.0, 5.0, 8.8, 5.6], [0.2, 1.0], 40, ClassId::Vehicles, 1);
    assert_eq!(ids_of_thing(&ids_of(&[&scan], &Settings::default())[0], &scan, 1), [0]);
}

#[test]
fn parked_cars_half_a_meter_apart_stay_two() {
    let cars = [car([8.0, 3.0], 1), car([12.7, 3.0], 2)].concat();
    let mut dense = Scan::new(HDL32);
    for idx in 0..20_u8 {
        dense.sweep(HDL32, [f32::from(idx) * 0.8, 0.0], i64::from(idx) * SWEEP_NANOS, &cars);
    }
    let mut sparse = Scan::new(HDL64);
    sparse.sweep(HDL64, [10.0, -4.0], 0, &cars);
    for scan in [&dense, &sparse] {
        let ids = &ids_of(&[scan], &Settings::default())[0];
        let first = ids_of_thing(ids, scan, 1);
        let second = ids_of_thing(ids, scan, 2);
        assert_eq!((first.len(), second.len()), (1, 1), "{first:?} {second:?}");
        assert!(first != second && first != [0] && second != [0], "{first:?} {second:?}");
    }
}

/// A car 20 m ahead and a car 20 m behind, both at the speed of the vehicle, 33 m/s, unmarked, next to a standing car: submaps of 7
/// sweeps, as `slam_aggregate` makes at this speed.
fn motorway() -> Vec<Scan> {
    let scan = |first: u8| {
        let mut scan = Scan::new(HDL64);
        for idx in first..first + 7 {
            let x = f32::from(idx) * 3.3;
            let cars = [car([x + 20.0, -0.9], 1), car([x - 24.0, -0.9], 2), car([40.0, -5.5], 3)].concat();
            scan.sweep(HDL64, [x, 0.0], i64::from(idx) * SWEEP_NANOS, &cars);
        }
        scan
    };
    [0, 7, 14].map(scan).into()
}

#[test]
fn cars_at_the_speed_of_the_vehicle_on_a_motorway_keep_one_id_each() {
    let scans = motorway();
    let ids = ids_of(&scans.iter().collect::<Vec<_>>(), &Settings::default());
    let of_thing = |thing| -> BTreeSet<u32> {
        ids.iter().zip(&scans).flat_map(|(ids, scan)| ids_of_thing(ids, scan, thing)).collect()
    };
    let each = [1, 2, 3].map(of_thing);
    assert!(each.iter().all(|ids| ids.len() == 1 && !ids.contains(&0)), "{each:?}");
    assert_eq!(each.iter().flatten().collect::<BTreeSet<_>>().len(), 3, "{each:?}");
}

#[test]
fn cars_that_drive_along_are_named_as_moving_and_standing_ones_are_not() {
    let scans = motorway();
    let columns = columns_of(&scans.iter().collect::<Vec<_>>(), &Settings::default());
    for (column, scan) in columns.iter().zip(&scans) {
        let id = |thing| ids_of_thing(column.rows(), scan, thing);
        let driving: BTreeSet<u32> = [id(1), id(2)].concat().into_iter().collect();
        assert_eq!(column.header().moving(), driving.into_iter().collect::<Vec<_>>());
        assert!(!column.header().moving().contains(&id(3)[0]));
    }
}

/// A vehicle with a hood in front of its LiDAR, driving 15 m past a car.
fn with_hood(has_hood: bool) -> Scan {
    let mut scan = Scan::new(HDL32);
    for idx in 0..15_u8 {
        let x = f32::from(idx);
        let mut blocks: Vec<Block> = car([12.0, 3.0], 1).into();
        if has_hood {
            let min = [x + 1.2, -0.8, 0.5];
            let max = [x + 2.2, 0.8, 0.9];
            blocks.push(Block { min, max, class: ClassId::Vehicles, thing: 2, is_marked: false });
        }
        scan.sweep(HDL32, [x, 0.0], i64::from(idx) * SWEEP_NANOS, &blocks);
    }
    scan
}

#[test]
fn hood_of_own_vehicle_is_no_object() {
    let scan = with_hood(true);
    let ids = &ids_of(&[&scan], &Settings::default())[0];
    assert_eq!(ids_of_thing(ids, &scan, 1), [1]);
    let n_hood = scan.street.truth.iter().filter(|thing| **thing == 2).count();
    let n_with_id = ids.iter().zip(&scan.street.truth).filter(|(id, thing)| **thing == 2 && **id != 0).count();
    assert!(n_hood > 1000 && n_with_id == 0, "{n_with_id} of {n_hood} points of the hood have an id");
    // Nothing else is left out.
    let without = with_hood(false);
    assert_eq!(ids_of_thing(&ids_of(&[&without], &Settings::default())[0], &without, 1), [1]);
}

/// A van 15 m ahead of the vehicle, both at 25 m/s: 20 sweeps in two submaps. Only its rear is visible.
fn van_ahead(is_marked: bool) -> [Scan; 2] {
    [0..10_u8, 10..20].map(|sweeps| {
        let mut scan = Scan::new(HDL32);
        for idx in sweeps {
            let x = f32::from(idx) * 2.5;
            let min = [x + 15.0, -0.9, 0.3];
            let max = [x + 20.0, 0.9, 2.2];
            let van = Block { min, max, class: ClassId::Vehicles, thing: 1, is_marked };
            scan.sweep(HDL32, [x, 0.0], i64::from(idx) * SWEEP_NANOS, &[van]);
        }
        scan
    })
}

#[test]
fn van_driving_ahead_over_twenty_sweeps_is_one_instance() {
    for is_marked in [true, false] {
        let [first, second] = &van_ahead(is_marked);
        let ids = ids_of(&[first, second], &Settings::default());
        assert_eq!(ids_of_thing(&ids[0], first, 1), [1], "marked: {is_marked}");
        assert_eq!(ids_of_thing(&ids[1], second, 1), [1], "marked: {is_marked}");
        let without_tracks = ids_of(&[first, second], &with_vehicles(|thing| thing.max_speed_mps = 0.0));
        assert!(ids_of_thing(&without_tracks[0], first, 1).len() > 1, "the tracks are what makes it one");
    }
}

#[test]
fn car_behind_a_fence_is_one_instance() {
    // Boards of 0.45 m with gaps of 0.3 m, 2 m in front of the car.
    let board = |idx: u8| {
        let x = 3.0 + 0.75 * f32::from(idx);
        let min = [x, 4.0, 0.0];
        let max = [x + 0.45, 4.05, 2.0];
        Block { min, max, class: ClassId::Fence, thing: 0, is_marked: false }
    };
    let mut blocks: Vec<Block> = (0..14).map(board).collect();
    blocks.extend(car([6.0, 6.0], 1));
    let mut scan = Scan::new(HDL64);
    scan.sweep(HDL64, [8.0, 0.0], 0, &blocks);
    let ids = |settings: &Settings| ids_of_thing(&ids_of(&[&scan], settings)[0], &scan, 1);
    assert_eq!(ids(&Settings::default()), [1]);
    let parts = ids(&with_vehicles(|thing| (thing.join_m, thing.peak_m) = (0.0, 0.0)));
    assert!(parts.len() > 1, "the fence does not split the car: {parts:?}");
}
