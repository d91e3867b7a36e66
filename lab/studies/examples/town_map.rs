//! Map of a simulated town by class, and class shares of its lidar returns.
//!
//! `cargo run --release -p studies --example town_map -- urban 1 12 FOLDER` writes `FOLDER/map_urban_1.png` (north up,
//! 0.25 m per pixel; the path of the ego vehicle in white), and prints class shares.

use messages::ClassId;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use raytrace::Ray;
use simulation::{DriveSpec, Simulation, Town};
use std::path::Path;

/// m per pixel.
const PIXEL_M: f64 = 0.25;
/// Border around the path, m.
const BORDER_M: f64 = 90.0;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [town, seed, seconds, folder] = words.as_slice() else {
        eprintln!("usage: town_map urban|suburban|rural|field|tunnel|motorway SEED SECONDS FOLDER");
        std::process::exit(2);
    };
    let town: Town = town.parse().expect("a kind of town");
    let spec = DriveSpec {
        town,
        ..DriveSpec::urban(seed.parse().expect("a seed"), seconds.parse().expect("seconds")).sparse(9)
    };
    let simulation = Simulation::new(&spec).expect("a town");
    println!(
        "{} {seed}: {} primitives, {} movers",
        town,
        simulation.scene.n_primitives(),
        simulation.scene.movers().len()
    );
    print_rates(&simulation);
    let image = map(&simulation);
    let path = Path::new(folder).join(format!("map_{town}_{seed}.png"));
    image.save(&path).expect("a picture");
    println!("{}", path.display());
}

/// The shares of the classes among the lidar's returns.
fn print_rates(simulation: &Simulation) {
    let lidar = simulation.lidar();
    let counts: Vec<[u32; 23]> = (0..lidar.model().n_packets(simulation.spec.seconds))
        .into_par_iter()
        .map(|packet| {
            let mut counts = [0; 23];
            for found in lidar.packet(packet).iter().flat_map(|block| block.returns.iter().flatten()) {
                counts[found.class as usize] += 1;
            }
            counts
        })
        .collect();
    let sum = |class: usize| counts.iter().map(|c| u64::from(c[class])).sum::<u64>();
    let total: u64 = (0..23).map(sum).sum();
    for class in ClassId::ALL {
        println!("{:>14} {:6.2} %", class.name(), 100.0 * sum(*class as usize) as f64 / total.max(1) as f64);
    }
}

/// The class that a vertical ray hits at each pixel.
fn map(simulation: &Simulation) -> image::RgbImage {
    let n = (simulation.spec.seconds * 10.0) as usize;
    let way: Vec<Vector3<f64>> = (0..=n).map(|i| simulation.motion.pose(i as f64 * 0.1).translation.vector).collect();
    let (low, high) =
        way.iter().fold((way[0].xy(), way[0].xy()), |(low, high), p| (low.inf(&p.xy()), high.sup(&p.xy())));
    let low = low.add_scalar(-BORDER_M);
    let high = high.add_scalar(BORDER_M);
    let size = ((high - low) / PIXEL_M).map(|v| v.ceil() as u32);
    let snapshot = simulation.scene.at(0.5 * simulation.spec.seconds);
    let rows: Vec<Vec<[u8; 3]>> = (0..size.y)
        .into_par_iter()
        .map(|row| {
            (0..size.x)
                .map(|column| {
                    let p = Vector2::new(low.x + f64::from(column) * PIXEL_M, high.y - f64::from(row) * PIXEL_M);
                    let origin = Vector3::new(p.x, p.y, 120.0).cast();
                    let ray = Ray { origin, direction: -Vector3::z(), seed: u64::from(row * size.x + column) };
                    match simulation.scene.cast(&snapshot, &ray, 300.0) {
                        Some(hit) => color(hit.surface.class, hit.normal.z),
                        None => [0, 0, 0],
                    }
                })
                .collect()
        })
        .collect();
    let mut image = image::RgbImage::from_fn(size.x, size.y, |x, y| image::Rgb(rows[y as usize][x as usize]));
    for p in &way {
        let at = ((p.xy() - low) / PIXEL_M).map(|v| v as u32);
        let row = size.y.saturating_sub(at.y + 1);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            if at.x + dx < size.x && row + dy < size.y {
                image.put_pixel(at.x + dx, row + dy, image::Rgb([255, 255, 255]));
            }
        }
    }
    image
}

/// The colors of CARLA's palette, darker where the surface is steep.
fn color(class: ClassId, up: f32) -> [u8; 3] {
    let rgb: [u8; 3] = match class {
        ClassId::Unlabeled => [0, 0, 0],
        ClassId::Building => [90, 90, 90],
        ClassId::Fence => [190, 153, 153],
        ClassId::Other => [255, 120, 50],
        ClassId::Pedestrian => [220, 20, 60],
        ClassId::Pole => [230, 230, 140],
        ClassId::RoadLine => [230, 234, 200],
        ClassId::Road => [128, 64, 128],
        ClassId::Sidewalk => [244, 35, 232],
        ClassId::Vegetation => [107, 142, 35],
        ClassId::Vehicles => [60, 100, 255],
        ClassId::Wall => [160, 160, 220],
        ClassId::TrafficSign => [240, 240, 0],
        ClassId::Sky => [70, 130, 180],
        ClassId::Ground => [150, 90, 60],
        ClassId::Bridge => [180, 130, 90],
        ClassId::RailTrack => [240, 170, 140],
        ClassId::GuardRail => [250, 250, 250],
        ClassId::TrafficLight => [250, 170, 30],
        ClassId::Static => [110, 190, 160],
        ClassId::Dynamic => [170, 120, 50],
        ClassId::Water => [45, 60, 200],
        ClassId::Terrain => [145, 210, 120],
    };
    let shade = 0.55 + 0.45 * up.abs();
    rgb.map(|part| (f32::from(part) * shade) as u8)
}
