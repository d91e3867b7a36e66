//! CPU time of networks on points and of one kernel point convolution, us per point:
//! `RAYON_NUM_THREADS=1 cargo run --release -p studies --example bench_points [FILE …]`.
//!
//! Files are written by `lab/peers/point_networks.py time`, which prints these times next to the times of `PyTorch`.

use candle_core::{Device, Tensor, Var};
use kernels::points::{Activation, KernelPoints, Lists, Neighborhood, kernel_point_convolution};
use neighbors::SpatialIndex;
use random::Random;
use safetensors::SafeTensors;
use segmentation::ModelFile;
use segmentation::points::{Parameters, Pass, PointBatch, PointNetworkSpec};
use std::path::Path;
use std::sync::Arc;

/// CPU time of all threads so far, us.
fn processor_us() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").expect("a Linux kernel");
    let of_thread = |thread: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    threads.filter_map(of_thread).sum::<f64>() * 1e-3
}

/// The fastest of some runs, after one that fetches its memory.
fn fastest_us<R>(n: usize, mut run: impl FnMut() -> R) -> f64 {
    run();
    let once = |_| {
        let begin = processor_us();
        run();
        processor_us() - begin
    };
    (0..n).map(once).fold(f64::INFINITY, f64::min)
}

fn gauss(random: &mut Random, shape: &[usize]) -> Tensor {
    let values: Vec<f32> = (0..shape.iter().product()).map(|_| random.gauss()).collect();
    Tensor::from_vec(values, shape, &Device::Cpu).expect("shape of the values")
}

/// A kernel point convolution, 64 to 64 channels, of 8192 points with 32 neighbors.
fn kernel_points() {
    const POINTS: usize = 8192;
    let mut random = Random::new(1);
    let points: Vec<[f32; 3]> =
        (0..POINTS).map(|_| [random.range(-4.0, 4.0), random.range(-4.0, 4.0), 0.1 * random.gauss()]).collect();
    let index = SpatialIndex::new(&points);
    let sorted: Vec<[f32; 3]> = index.order().iter().map(|point| points[*point as usize]).collect();
    for (order, points) in [("Morton order", sorted), ("shuffled", points)] {
        let near = SpatialIndex::new(&points).nearest_of_own(32);
        let lists = (0..POINTS).map(|point| near.get(point).iter().map(|neighbor| neighbor.index).collect::<Vec<_>>());
        let lists = Arc::new(Lists::new(lists, POINTS));
        let farthest =
            (0..POINTS).filter_map(|point| near.get(point).last()).map(|neighbor| neighbor.squared_m2.sqrt());
        let radius = farthest.sum::<f32>() / POINTS as f32;
        let points = Arc::new(points);
        let at = Neighborhood { queries: points.clone(), support: points, lists };
        let kernel: Vec<[f32; 3]> =
            (0..15).map(|_| std::array::from_fn(|_| random.range(-0.6, 0.6) * radius)).collect();
        let kernel = KernelPoints::new(&kernel, 0.48 * radius);
        let inputs = [gauss(&mut random, &[POINTS, 64]), gauss(&mut random, &[15, 64, 64]), gauss(&mut random, &[64])];
        let run = |t: &[Tensor]| {
            kernel_point_convolution(&t[0], &t[1], &t[2], &at, &kernel, Activation::LEAKY).expect("runs")
        };
        let forward = fastest_us(15, || run(&inputs));
        let variables: Vec<Var> = inputs.iter().map(|t| Var::from_tensor(t).expect("f32")).collect();
        let variables: Vec<Tensor> = variables.iter().map(|v| v.as_tensor().clone()).collect();
        let both = fastest_us(7, || run(&variables).sum_all().and_then(|sum| sum.backward()).expect("has gradients"));
        let per_point = POINTS as f64;
        println!(
            "KPConv 64 -> 64, {order}: forward {:.2}, forward and backward {:.2} us/point",
            forward / per_point,
            both / per_point
        );
    }
}

fn network(path: &Path) {
    let bytes = std::fs::read(path).expect("readable");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    let values = |name: &str| -> Vec<f32> {
        let tensor = file.tensor(name).expect("written by the script");
        tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    };
    let model = ModelFile::read(path).expect("a model file");
    let spec: PointNetworkSpec = model.settings().expect("a network");
    let list = spec.parameters();
    let parameters = Parameters::from_file(&list, &model).expect("all parameters");
    let positions = values("test.positions").as_chunks::<3>().0.to_vec();
    let n = positions.len();
    let lengths = values("test.lengths").iter().map(|length| *length as usize).collect();
    let batch = PointBatch::new(positions, lengths).expect("valid");
    let features = Tensor::from_vec(values("test.features"), (n, spec.inputs()), &Device::Cpu).expect("rows");
    let plan_us = fastest_us(3, || spec.plan(batch.clone(), 1).expect("valid"));
    let plan = spec.plan(batch, 1).expect("valid");
    let forward = fastest_us(7, || spec.run(&mut Pass::evaluation(&parameters), &plan, &features).expect("runs"));
    let trainable = parameters.trainable(&list).expect("f32");
    let both = fastest_us(3, || {
        let mut pass = Pass::training(&trainable, Random::new(1));
        let scores = spec.run(&mut pass, &plan, &features).expect("runs");
        scores.sqr().and_then(|squares| squares.mean_all()).and_then(|mean| mean.backward()).expect("has gradients")
    });
    let n = n as f64;
    println!("{} {:.3} {:.3} {:.3}", path.display(), plan_us / n, forward / n, both / n);
}

fn main() {
    // As in `replica-lab train`.
    allocator::restart_with_kept_memory(allocator::Keep::Large);
    let files: Vec<_> = std::env::args_os().skip(1).collect();
    for file in &files {
        network(Path::new(file));
    }
    if files.is_empty() {
        kernel_points();
    }
}
