//! Speed of the convolution kernels on one thread, compared with candle's own:
//! `RAYON_NUM_THREADS=1 cargo run --release -p studies --example bench_convolution`.
//! One line of tab-separated values for each shape, to which `lab/peers/segmentation.py` adds other programs.

use candle_core::{Device, Tensor};
use kernels::images::{Border, Filter, Planes, Shape, convolve};
use std::time::Instant;
use training::derivatives::{input_gradient, transposed_filters, weight_gradient};

/// Shapes: channels in and out, height, width, side of the filter.
const CASES: [[usize; 5]; 9] = [
    [32, 32, 64, 1024, 3],
    [96, 32, 64, 1024, 3],
    [64, 64, 32, 512, 3],
    [48, 32, 32, 512, 3],
    [32, 32, 32, 512, 5],
    [64, 96, 32, 512, 1],
    [96, 48, 16, 256, 3],
    [128, 64, 8, 128, 3],
    [96, 96, 4, 64, 3],
];

/// Repetitions; the fastest counts, since the machine may be shared.
const RUNS: usize = 7;

fn fastest(mut run: impl FnMut()) -> f64 {
    let seconds = |run: &mut dyn FnMut()| {
        let begin = Instant::now();
        run();
        begin.elapsed().as_secs_f64()
    };
    (0..RUNS).map(|_| seconds(&mut run)).fold(f64::INFINITY, f64::min)
}

fn main() -> Result<(), candle_core::Error> {
    println!(
        "in\tout\theight\twidth\tkernel\tours_ms\tours_gflops\tinput_gradient_ms\tweight_gradient_ms\tcandle_ms\tlargest_difference"
    );
    for [n_in, n_out, height, width, side] in CASES {
        let shape =
            Shape { kernel: [side; 2], stride_x: 1, in_channels: vec![n_in], out_channels: n_out, rectify: false };
        let value = |i: usize| (i as f32 * 0.618_034).fract() - 0.5;
        let weights: Vec<f32> = (0..n_out * n_in * side * side).map(value).collect();
        let pixels: Vec<f32> = (0..n_in * height * width).map(|i| value(i * 7)).collect();
        let filter = Filter::new(shape.clone(), &weights, &vec![0.0; n_out]);
        let pixel = |channel, y, x| pixels[(channel * height + y) * width + x];
        let image = Planes::from_fn([n_in, height, width], Border::Zero, pixel);
        let mut out = Planes::zeros(n_out, height, width);
        let ours = fastest(|| convolve(&filter, &[&image], &mut out));
        let transposed = transposed_filters(&filter);
        let by_input = fastest(|| {
            assert_eq!(input_gradient(&transposed[0], 1, &out, Border::Zero).channels(), shape.in_channels[0]);
        });
        let by_weights = fastest(|| assert!(!weight_gradient(&shape, &[&image], &out).is_empty()));

        let tensor = Tensor::from_vec(pixels, (1, n_in, height, width), &Device::Cpu)?;
        let kernel = Tensor::from_vec(weights, (n_out, n_in, side, side), &Device::Cpu)?;
        let result = tensor.conv2d(&kernel, side / 2, 1, 1, 1)?.flatten_all()?.to_vec1::<f32>()?;
        let candle = fastest(|| drop(tensor.conv2d(&kernel, side / 2, 1, 1, 1)));
        let at =
            |i: usize| out.row(i / (height * width) / 16, i / width % height)[i % width][i / (height * width) % 16];
        let difference = result.iter().enumerate().map(|(i, v)| (v - at(i)).abs()).fold(0.0, f32::max);
        let flops = (filter.flops_per_pixel() * height * width) as f64;
        println!(
            "{n_in}\t{n_out}\t{height}\t{width}\t{side}\t{:.3}\t{:.1}\t{:.3}\t{:.3}\t{:.3}\t{difference:.2e}",
            ours * 1e3,
            flops / ours * 1e-9,
            by_input * 1e3,
            by_weights * 1e3,
            candle * 1e3
        );
    }
    Ok(())
}
