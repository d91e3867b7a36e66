//! Time and memory of a model on points for one large submap, everything included: ground, cells, neighborhoods, network, votes.
//! `cargo run --release -p studies --example bench_point_model -- MODEL SUBMAP`.
//!
//! `lab/peers/point_networks.py submap` writes the submap and runs the same network in `PyTorch` in addition to this program.

use messages::{ClassRow, SubmapHeader, SubmapPoint, SubmapSweep};
use neighbors::{SpatialIndex, VoxelGrid};
use safetensors::SafeTensors;
use segmentation::points::{PointModel, sphere};
use segmentation::{ModelInput, Segmenter};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// CPU time of all threads so far, s: unlike wall time, it excludes other users of the machine.
fn processor_s() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").expect("a Linux kernel");
    let of_thread = |thread: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    threads.filter_map(of_thread).sum::<f64>() * 1e-9
}

/// Largest memory of the process so far, MB.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("a Linux kernel");
    let kib =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok());
    kib.map_or(f64::NAN, |kib: f64| kib * 1.024e-3)
}

fn submap(path: &Path) -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
    let bytes = std::fs::read(path).expect("readable");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    let values = |name: &str| -> Vec<f32> {
        let tensor = file.tensor(name).expect("written by the script");
        tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    };
    let positions = values("points");
    let points = positions.as_chunks::<3>().0.iter();
    let points: Vec<SubmapPoint> =
        points.map(|[x, y, z]| SubmapPoint { x: *x, y: *y, z: *z, ..SubmapPoint::default() }).collect();
    let mut header: Box<SubmapHeader> = Box::default();
    let origins = values("origins");
    let ends = values("ends");
    let mut first_point = 0;
    for (sweep, (origin, end)) in header.sweeps.iter_mut().zip(origins.as_chunks::<3>().0.iter().zip(ends)) {
        let here = [origin[0], origin[1], origin[2], 0.0, 0.0, 0.0, 1.0];
        *sweep = SubmapSweep {
            first_point,
            n_points: end as u32 - first_point,
            duration_nanos: 100_000_000,
            submap_from_lidar_begin: here,
            submap_from_lidar_end: here,
            ..SubmapSweep::default()
        };
        first_point = end as u32;
        header.n_sweeps += 1;
    }
    header.n_rings = 64;
    (header, points)
}

fn main() {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [model, submap_file] = arguments.as_slice() else { panic!("give MODEL SUBMAP") };
    let model = PointModel::load(Path::new(model)).expect("a model file");
    let (header, points) = submap(Path::new(submap_file));
    let before_mb = peak_mb();
    let mut classes = vec![ClassRow::default(); points.len()];
    let begin = Instant::now();
    let begin_s = processor_s();
    let input = ModelInput::new(&header, &points);
    let report = model.segment(&input, &mut classes).expect("runs");
    let wall_s = begin.elapsed().as_secs_f64();
    let cpu_s = processor_s() - begin_s;
    let mut counts: BTreeMap<u8, usize> = BTreeMap::new();
    for row in &classes {
        *counts.entry(row.class_id).or_default() += 1;
    }
    let n = points.len() as f64;
    println!(
        "{n} points, {} threads: {wall_s:.2} s, {cpu_s:.2} CPU s: {:.0} points/s, {:.0} points per CPU second; peak {:.0} MB, {before_mb:.0} MB of them before",
        std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        n / wall_s,
        n / cpu_s,
        peak_mb()
    );
    let positions: Vec<[f32; 3]> = points.iter().map(|point| [point.x, point.y, point.z]).collect();
    let cells = VoxelGrid::new(&positions, model.settings().cell_m).expect("a side").barycenters(&positions);
    let index = SpatialIndex::new(&cells);
    let spheres = model.settings().spheres;
    let centers = spheres.centers(&cells).expect("valid");
    let n_seen: usize = centers.iter().map(|center| sphere(&index, *center, spheres.radius_m).len()).sum();
    println!("{} cells, {} spheres with {n_seen} cells", cells.len(), centers.len());
    println!("{} points without class; points of each class {counts:?}", report.n_unseen);
}
