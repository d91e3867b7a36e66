//! Derivatives of single operations, by adjointness: <A x, g> = <x, A' g> for a linear map A. It holds up to rounding and covers
//! every entry at once.

use kernels::images::{Border, Filter, PlainFilter, Planes, Shape, convolve, max_pool, upsample};
use random::Random;
use training::derivatives::{
    input_gradient, max_pool_gradient, transposed_filters, upsample_gradient, weight_gradient,
};

fn random_planes(size: [usize; 3], border: Border, random: &mut Random) -> Planes {
    Planes::from_fn(size, border, |_, _, _| random.range(-1.0, 1.0))
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

fn product(a: &Planes, b: &Planes) -> f64 {
    dot(a.to_inner().as_flattened(), b.to_inner().as_flattened())
}

#[test]
fn convolution_derivatives_are_adjoint_to_convolution() {
    let mut random = Random::new(2);
    let cases = [
        ([3, 3], 1, &[16][..], 32, [4, 16], Border::Circular),
        ([3, 3], 1, &[5], 20, [3, 13], Border::Zero),
        ([3, 3], 1, &[20, 35], 70, [12, 40], Border::Circular),
        ([3, 3], 1, &[40], 64, [4, 8], Border::Zero),
        ([1, 1], 1, &[32, 7], 48, [2, 9], Border::Circular),
        ([5, 5], 2, &[20, 3], 17, [5, 22], Border::Circular),
        ([5, 5], 1, &[3], 4, [1, 4], Border::Zero),
        ([3, 3], 2, &[16], 16, [2, 8], Border::Zero),
    ];
    for (kernel, stride_x, in_channels, out_channels, [height, width], border) in cases {
        let shape = Shape { kernel, stride_x, in_channels: in_channels.to_vec(), out_channels, rectify: false };
        let n_in: usize = in_channels.iter().sum();
        let mut values = |n: usize| (0..n).map(|_| random.range(-0.5, 0.5)).collect::<Vec<f32>>();
        let weights = values(out_channels * n_in * kernel[0] * kernel[1]);
        let biases = values(out_channels);
        let filter = Filter::new(shape.clone(), &weights, &biases);
        let sources: Vec<Planes> =
            in_channels.iter().map(|&n| random_planes([n, height, width], border, &mut random)).collect();
        let borrowed: Vec<&Planes> = sources.iter().collect();
        let mut out = Planes::zeros(out_channels, height, width / stride_x);
        convolve(&filter, &borrowed, &mut out);
        let gradient = random_planes([out_channels, height, width / stride_x], border, &mut random);
        let total = product(&out, &gradient);
        let near = |got: f64, expected: f64| {
            assert!((got - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{shape:?}: {got} for {expected}");
        };

        let by_weights = weight_gradient(&shape, &borrowed, &gradient);
        assert_eq!(by_weights.len(), shape.packed_rows());
        let PlainFilter { weights: by_weights, biases: by_biases } = shape.unpacked(&by_weights);
        let of_biases = dot(&by_biases, &biases);
        near(dot(&by_weights, &weights) + of_biases, total);

        let by_source = |(transposed, source): (&Filter, &Planes)| {
            product(&input_gradient(transposed, stride_x, &gradient, border), source)
        };
        let from_sources: f64 = transposed_filters(&filter).iter().zip(&sources).map(by_source).sum();
        near(from_sources, total - of_biases);
    }
}

#[test]
fn pooling_and_upsampling_derivatives_are_adjoint() {
    let mut random = Random::new(3);
    let factor = [2, 3];
    let image = random_planes([19, 4, 6], Border::Zero, &mut random);
    let mut pooled = Planes::zeros(19, 2, 2);
    max_pool(&image, factor, &mut pooled);
    let gradient = random_planes([19, 2, 2], Border::Zero, &mut random);
    let by_image = max_pool_gradient(&image, &pooled, &gradient, factor);
    let sum = |planes: &Planes| planes.to_inner().iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    assert!((sum(&by_image) - sum(&gradient)).abs() < 1e-5);
    // Each window passes its derivative to its maximum.
    assert!((product(&by_image, &image) - product(&gradient, &pooled)).abs() < 1e-4);

    let mut large = Planes::zeros(19, 4, 6);
    upsample(&pooled, factor, &mut large);
    let of_large = random_planes([19, 4, 6], Border::Zero, &mut random);
    let of_small = upsample_gradient(&of_large, factor);
    assert!((product(&of_small, &pooled) - product(&of_large, &large)).abs() < 1e-4);
}
