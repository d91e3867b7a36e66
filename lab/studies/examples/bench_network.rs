//! CPU time of one HDL-32E sweep of a submap through a model on range images, on one thread:
//! `RAYON_NUM_THREADS=1 cargo run --release -p studies --example bench_network -- models/street.safetensors`.

use geometry::RangeImage;
use kernels::images::Border;
use messages::{ClassRow, SubmapHeader, SubmapPoint, SubmapSweep};
use segmentation::network::Inference;
use segmentation::spherical::{LoadedModel, PolarImage, PolarPixel, SphericalModel, features};
use segmentation::{ModelInput, Segmenter};
use std::path::PathBuf;

const RINGS: usize = 32;
/// Rounds of firings of one revolution.
const FIRINGS: usize = 2170;

/// CPU time of all threads so far, ms: unlike wall time, it excludes other users of the machine.
fn processor_ms() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").expect("a Linux kernel");
    let of_thread = |thread: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    threads.filter_map(of_thread).sum::<f64>() * 1e-6
}

/// Mean of a few runs after one that fetches its memory. The kernel counts in steps of some ms: smaller times need many runs.
fn mean_ms(n: usize, mut run: impl FnMut()) -> f64 {
    run();
    let begin = processor_ms();
    (0..n).for_each(|_| run());
    (processor_ms() - begin) / n as f64
}

/// Sweeps of a submap: 20 m at 9 m/s.
const SWEEPS: usize = 22;

/// Revolutions between two walls on a flat road, 1.8 m below the sensor, 0.9 m from one to the next.
fn submap() -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
    let mut header: Box<SubmapHeader> = Box::default();
    header.n_rings = RINGS as u32;
    header.n_sweeps = SWEEPS as u32;
    let mut points: Vec<SubmapPoint> = Vec::new();
    for sweep in 0..SWEEPS {
        let first_point = points.len() as u32;
        let along = 0.9 * sweep as f32;
        points.extend(turn().into_iter().map(|point| SubmapPoint { x: point.x + along, ..point }));
        let here = [along, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        header.sweeps[sweep] = SubmapSweep {
            first_point,
            n_points: points.len() as u32 - first_point,
            duration_nanos: 100_000_000,
            submap_from_lidar_begin: here,
            submap_from_lidar_end: here,
            ..SubmapSweep::default()
        };
    }
    (header, points)
}

fn turn() -> Vec<SubmapPoint> {
    let mut points = Vec::new();
    for firing in 0..FIRINGS {
        let azimuth = firing as f32 / FIRINGS as f32 * 360.0;
        for ring in 0..RINGS {
            let up = (-30.67 + 4.0 / 3.0 * ring as f32).to_radians();
            let (sin, cos) = azimuth.to_radians().sin_cos();
            let ray = [up.cos() * cos, -up.cos() * sin, up.sin()];
            let to_road = if ray[2] < 0.0 { -1.8 / ray[2] } else { f32::INFINITY };
            let range = to_road.min(9.0 / ray[1].abs()).min(60.0);
            points.push(SubmapPoint {
                x: ray[0] * range,
                y: ray[1] * range,
                z: ray[2] * range,
                azimuth: (azimuth * 100.0) as u16,
                ring: ring as u8,
                intensity: 20,
                ..SubmapPoint::default()
            });
        }
    }
    points
}

fn main() -> Result<(), segmentation::SegmentationError> {
    let path = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("models/street.safetensors"), PathBuf::from);
    let LoadedModel { model, weights } = SphericalModel::load(&path)?;
    let settings = model.settings();
    let (header, points) = submap();
    let cloud = ModelInput::new(&header, &points);
    let mut classes = vec![ClassRow::default(); points.len()];
    let whole = mean_ms(4, || assert!(model.segment(&cloud, &mut classes).is_ok())) / SWEEPS as f64;
    let points = turn();

    let placed = points.iter().map(|point| {
        let column = geometry::column_of_azimuth(point.azimuth, settings.columns);
        (Some((RINGS - 1 - usize::from(point.ring), column)), (point.x.powi(2) + point.y.powi(2)).sqrt())
    });
    let image = RangeImage::new(RINGS, settings.columns, placed);
    let polar = PolarImage::from_range_image(&image, true, |i| {
        let point = &points[i];
        PolarPixel { ray: [point.x, point.y, point.z], height_m: point.z + 1.8, intensity: point.intensity }
    });
    let mut input = features(&polar, &settings.features, settings.fold, 1);
    let features_ms = mean_ms(50, || input = features(&polar, &settings.features, settings.fold, 1));
    let network = Inference::new(settings.network.clone(), &weights, Border::Circular)?;
    let input = input.to_tensor()?;
    let network_ms = mean_ms(50, || assert!(network.run(&input).is_ok()));
    let gflop = model.flops(RINGS) as f64 * 1e-9;
    println!(
        "one sweep of {} points: {whole:.2} ms in all, of that features {features_ms:.2} ms, network {network_ms:.2} ms ({gflop:.2} GFLOP, {:.0} GF/s)",
        points.len(),
        gflop / network_ms * 1e3
    );
    Ok(())
}
