//! Drives in which the LiDAR cannot be where its mounting says.

use infer::{Infer, Settings};
use messages::{SubmapHeader, SubmapPoint, SubmapTopic};
use stage::testing::{Bench, context};
use std::path::Path;

/// A street along x with a wall on both sides, in the frame of the first sweep of a LiDAR on a vehicle.
struct Street {
    has_road: bool,
    /// Distance of the walls from the path, m.
    wall_m: f32,
    /// Height of the walls above the LiDAR, m.
    top_m: f32,
    /// Distance between two sweeps, m.
    step_m: f32,
}

const STREET: Street = Street { has_road: true, wall_m: 5.0, top_m: 7.0, step_m: 2.0 };

impl Street {
    /// Eight sweeps of an HDL-32E 1.9 m above the road. `placed` turns positions and points.
    fn submap(&self, placed: impl Fn([f32; 3]) -> [f32; 3]) -> (SubmapHeader, Vec<SubmapPoint>) {
        let mut header = SubmapHeader { n_rings: 32, n_sweeps: 8, ..SubmapHeader::default() };
        let mut points = Vec::new();
        for number in 0..8_usize {
            let first_point = points.len() as u32;
            let start = number as f32 * self.step_m;
            for (firing, ring) in (0..720_u32).flat_map(|firing| (0..32_u8).map(move |ring| (firing, ring))) {
                let (sin, cos) = (firing as f32 / 2.0).to_radians().sin_cos();
                let (up, level) = (-30.67 + 4.0 / 3.0 * f32::from(ring)).to_radians().sin_cos();
                let ray = [level * cos, -level * sin, up];
                let to_road = if up < 0.0 { -1.9 / up } else { f32::INFINITY };
                let to_wall = self.wall_m / ray[1].abs();
                let is_on_road = to_road < to_wall;
                let range = to_road.min(to_wall);
                if range < 60.0 && if is_on_road { self.has_road } else { range * up < self.top_m } {
                    let [x, y, z] = placed([start + ray[0] * range, ray[1] * range, ray[2] * range]);
                    points.push(SubmapPoint { x, y, z, azimuth: (firing * 50) as u16, ring, ..Default::default() });
                }
            }
            let [x, y, z] = placed([start, 0.0, 0.0]);
            let sweep = &mut header.sweeps[number];
            (sweep.first_point, sweep.n_points) = (first_point, points.len() as u32 - first_point);
            sweep.duration_nanos = 100_000_000;
            sweep.submap_from_lidar_begin = [x, y, z, 0.0, 0.0, 0.0, 1.0];
            sweep.submap_from_lidar_end = sweep.submap_from_lidar_begin;
        }
        (header, points)
    }
}

/// Share of misplaced submaps in the doubt, and of positions without ground on the path.
fn doubt(submap: (SubmapHeader, Vec<SubmapPoint>)) -> (Option<f64>, f64) {
    let settings = Settings { model: "models/ground.safetensors".to_owned(), ..Settings::default() };
    let at_root = context(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")));
    let mut bench = Bench::<Infer>::new(&settings, &at_root).expect("the model loads");
    bench.send::<SubmapTopic>(0, submap.0, submap.1);
    bench.tick().expect("steps");
    bench.finish().expect("an end");
    let n_bare = bench.counter("path_positions_without_ground") as f64;
    (bench.doubt("lidar_misplaced"), n_bare / bench.counter("path_positions").max(1) as f64)
}

#[test]
fn street_with_road_under_the_lidar_is_not_doubted() {
    assert_eq!(doubt(STREET.submap(|point| point)), (None, 0.0));
    let (sin, cos) = 9_f32.to_radians().sin_cos();
    let uphill = |[x, y, z]: [f32; 3]| [cos * x - sin * z, y, sin * x + cos * z];
    assert_eq!(doubt(STREET.submap(uphill)), (None, 0.0));
    // A LiDAR that stands has no path to look along.
    assert_eq!(doubt(Street { step_m: 0.0, ..STREET }.submap(|point| point)), (None, 0.0));
}

/// The tops of the walls are where a road is expected: below the LiDAR, flat and level.
#[test]
fn lidar_upside_down_between_low_walls_is_doubted() {
    let low_walls = Street { wall_m: 6.0, top_m: 1.5, ..STREET };
    let upside_down = |[x, y, z]: [f32; 3]| [x, -y, -z];
    assert_eq!(doubt(low_walls.submap(|point| point)), (None, 0.0));
    assert_eq!(doubt(low_walls.submap(upside_down)), (Some(1.0), 1.0));
}

/// The lowest points of facades are taken for ground, at the right height.
#[test]
fn street_of_facades_without_ground_is_doubted() {
    assert_eq!(doubt(Street { has_road: false, ..STREET }.submap(|point| point)), (Some(1.0), 1.0));
}
