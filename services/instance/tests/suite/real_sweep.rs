//! One real sweep of an HDL-32E with boxes (nuScenes): classes from the boxes, instances from the stage.

use crate::support::{at, bench};
use instance::Settings;
use messages::{
    ClassHeader, ClassId, ClassRow, ClassTopic, InstanceTopic, SubmapHeader, SubmapPoint, SubmapSweep, SubmapTopic,
};
use std::collections::BTreeMap;

/// Center, size and heading of a box in the frame of the LiDAR.
struct Cuboid([f32; 7]);

impl Cuboid {
    fn contains(&self, [x, y, z]: [f32; 3]) -> bool {
        let [x0, y0, z0, length, width, height, heading] = self.0;
        let (sin, cos) = heading.sin_cos();
        let dx = x - x0;
        let dy = y - y0;
        let along = dx * cos + dy * sin;
        let across = dy * cos - dx * sin;
        2.0 * along.abs() <= length && 2.0 * across.abs() <= width && 2.0 * (z - z0).abs() <= height
    }
}

fn floats(value: &serde_json::Value) -> Vec<f32> {
    value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number") as f32).collect()
}

/// The boxes of vehicles; points in them are vehicles, low other points are road.
fn boxes() -> Vec<Cuboid> {
    let text = std::fs::read_to_string(real_data::path("nuscenes/calib_and_boxes.json")).expect("reads");
    // Python writes NaN, which is not JSON.
    let table: serde_json::Value = serde_json::from_str(&text.replace("NaN", "null")).expect("is JSON");
    // 0 car to 6 motorcycle.
    let is_vehicle =
        |row: &&serde_json::Value| row["bbox_label_3d"].as_i64().is_some_and(|label| (0..7).contains(&label));
    let rows = table["instances"].as_array().expect("a list").iter().filter(is_vehicle);
    rows.map(|row| Cuboid(floats(&row["bbox_3d"]).try_into().expect("seven numbers"))).collect()
}

fn sweep() -> (SubmapHeader, Vec<SubmapPoint>) {
    let name = "nuscenes/n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";
    let bytes = std::fs::read(real_data::path(name)).expect("reads");
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let point = |row: &[u8]| {
        let [x, y, z, _, ring] = std::array::from_fn(|i| number(&row[4 * i..4 * i + 4]));
        let elevation = (z.atan2(x.hypot(y)).to_degrees() * 100.0) as i16;
        SubmapPoint { x, y, z, elevation, ring: ring as u8, ..SubmapPoint::default() }
    };
    // Returns of the vehicle itself are closer than 2 m.
    let points: Vec<SubmapPoint> = bytes.chunks_exact(20).map(point).filter(|p| p.x.hypot(p.y) > 2.0).collect();
    let mut header = SubmapHeader { n_rings: 32, n_sweeps: 1, ..at([0.0; 3]) };
    let pose = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    header.sweeps[0] = SubmapSweep {
        duration_nanos: 50_000_000,
        n_points: points.len() as u32,
        submap_from_lidar_begin: pose,
        submap_from_lidar_end: pose,
        ..SubmapSweep::default()
    };
    (header, points)
}

/// Numbers of boxes with at least 20 points, of these boxes that an instance matches above an IoU of 1/2, and of
/// instances that match no box.
fn found(settings: &Settings) -> (usize, usize, usize) {
    let boxes = boxes();
    let (header, points) = sweep();
    let box_of: Vec<Option<usize>> =
        points.iter().map(|p| boxes.iter().position(|cuboid| cuboid.contains([p.x, p.y, p.z]))).collect();
    let class = |(point, in_box): (&SubmapPoint, &Option<usize>)| match in_box {
        Some(_) => ClassId::Vehicles,
        None if point.z < -1.4 => ClassId::Road,
        None => ClassId::Building,
    };
    let classes: Vec<ClassRow> =
        points.iter().zip(&box_of).map(|pair| ClassRow { class_id: class(pair) as u8, score: 255 }).collect();
    let mut bench = bench(settings);
    bench.send::<SubmapTopic>(0, header, points);
    bench.send::<ClassTopic>(0, ClassHeader::default(), classes);
    bench.tick().expect("steps");
    let columns = bench.take::<InstanceTopic>();
    let mut of_box = BTreeMap::new();
    let mut of_id = BTreeMap::new();
    let mut both = BTreeMap::new();
    for (&id, in_box) in columns[0].rows().iter().zip(&box_of) {
        if let Some(cuboid) = *in_box {
            *of_box.entry(cuboid).or_insert(0) += 1;
        }
        if id != 0 {
            *of_id.entry(id).or_insert(0) += 1;
            if let Some(cuboid) = *in_box {
                *both.entry((cuboid, id)).or_insert(0) += 1;
            }
        }
    }
    of_box.retain(|_, n: &mut i32| *n >= 20);
    let is_match = |(&(cuboid, id), &n): (&(usize, u32), &i32)| {
        of_box.get(&cuboid).is_some_and(|n_of_box| 2 * n > n_of_box + of_id[&id] - n)
    };
    let n_matched = both.iter().filter(|pair| is_match(*pair)).count();
    (of_box.len(), n_matched, of_id.len() - n_matched)
}

#[real_data::test("nuscenes/calib_and_boxes.json")]
fn car_and_truck_of_one_real_sweep_are_found() {
    let (n_boxes, n_found, n_false) = found(&Settings::default());
    let mut of_thesis = Settings::default();
    of_thesis.things[0].min_share = 0.0;
    let (_, n_found_before, _) = found(&of_thesis);
    println!("{n_boxes} boxes with 20 points: {n_found} found, {n_false} false; by 500 points {n_found_before} found");
    // The false one is a second part of the truck, which is longer than `max_length_m`.
    assert_eq!((n_boxes, n_found, n_false), (2, 2, 1));
    assert_eq!(n_found_before, 0, "they have 51 and 494 points");
}

/// The numbers of a `.npy` file with values of four bytes.
fn npy(name: &str) -> Vec<[u8; 4]> {
    let bytes = std::fs::read(real_data::path(name)).expect("reads");
    let begin = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[begin..].chunks_exact(4).map(|value| value.try_into().expect("four bytes")).collect()
}

/// A sweep of an HDL-64E with true classes (`SemanticKITTI`): header, points, classes.
fn labeled_sweep(number: usize) -> (SubmapHeader, Vec<SubmapPoint>, Vec<ClassRow>) {
    let values = npy(&format!("semantickitti/kitti_01_points_00000{number}.npy"));
    let labels = npy(&format!("semantickitti/kitti_01_labels_00000{number}.npy"));
    let point = |row: &[[u8; 4]]| {
        let [x, y, z] = std::array::from_fn(|axis| f32::from_le_bytes(row[axis]));
        let elevation_deg = z.atan2(x.hypot(y)).to_degrees();
        // 64 rings from -24.8 to 2 degrees.
        let ring = (63.0 * (elevation_deg + 24.8) / 26.8).round().clamp(0.0, 63.0) as u8;
        SubmapPoint { x, y, z, elevation: (elevation_deg * 100.0) as i16, ring, ..SubmapPoint::default() }
    };
    let class = |label: &[u8; 4]| match i32::from_le_bytes(*label) {
        1 => ClassId::Vehicles,
        9 => ClassId::Road,
        17 => ClassId::Terrain,
        15 => ClassId::Vegetation,
        0 => ClassId::Unlabeled,
        _ => ClassId::Fence,
    };
    let points: Vec<SubmapPoint> = values.chunks_exact(3).map(point).collect();
    let classes = labels.iter().map(|label| ClassRow { class_id: class(label) as u8, score: 255 }).collect();
    let mut header = SubmapHeader { n_rings: 64, n_sweeps: 1, ..at([0.0; 3]) };
    header.sweeps[0] = SubmapSweep {
        n_points: points.len() as u32,
        submap_from_lidar_begin: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        submap_from_lidar_end: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ..SubmapSweep::default()
    };
    (header, points, classes)
}

/// Sizes of the groups of car points with gaps below 1 m.
fn groups(points: &[SubmapPoint], classes: &[ClassRow]) -> Vec<usize> {
    let is_car = |(_, row): &(&SubmapPoint, &ClassRow)| row.class_id == ClassId::Vehicles as u8;
    let mut waiting: Vec<&SubmapPoint> = points.iter().zip(classes).filter(is_car).map(|(point, _)| point).collect();
    let mut sizes = Vec::new();
    while let Some(first) = waiting.pop() {
        let mut group = vec![first];
        let mut next = 0;
        while let Some(&member) = group.get(next) {
            let is_near = |p: &&SubmapPoint| (p.x - member.x).hypot(p.y - member.y) < 1.0;
            let (near, far) = waiting.into_iter().partition(is_near);
            group.extend::<Vec<_>>(near);
            waiting = far;
            next += 1;
        }
        sizes.push(group.len());
    }
    sizes
}

#[real_data::test("semantickitti/kitti_01_points_000000.npy")]
fn cars_of_real_motorway_sweeps_are_found() {
    let mut of_thesis = Settings::default();
    of_thesis.things[0].min_share = 0.0;
    for number in 0..3 {
        let (header, points, classes) = labeled_sweep(number);
        let n_groups = groups(&points, &classes).into_iter().filter(|n| *n >= 20).count() as u32;
        let n_found = |settings: &Settings| {
            let mut bench = bench(settings);
            bench.send::<SubmapTopic>(0, header, points.clone());
            bench.send::<ClassTopic>(0, ClassHeader::default(), classes.clone());
            bench.tick().expect("steps");
            bench.take::<InstanceTopic>()[0].header().n_instances
        };
        let now = n_found(&Settings::default());
        let by_count = n_found(&of_thesis);
        println!("sweep {number}: {n_groups} groups with 20 points, {now} instances, {by_count} by 500 points");
        assert!(now.abs_diff(n_groups) <= 1 && by_count < now, "sweep {number}: {n_groups} groups, {now} found");
    }
}
