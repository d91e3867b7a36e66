//! The kernels against the sums that they stand for.

mod support;

use learning::engine::{
    Border, Filter, LANES, Planes, Shape, convolve, input_gradient, max_pool, max_pool_gradient, upsample,
    upsample_gradient, weight_gradient,
};
use support::Random;

/// An image by channel, row and column, of any numbers.
struct Image {
    size: [usize; 3],
    values: Vec<f32>,
}

impl Image {
    fn random(size: [usize; 3], random: &mut Random) -> Self {
        Self { size, values: (0..size.iter().product()).map(|_| random.between(-1.0, 1.0)).collect() }
    }
    fn at(&self, channel: usize, y: isize, x: isize, border: Border) -> f32 {
        let [_, height, width] = self.size;
        let x = if border == Border::Circular { x.rem_euclid(width as isize) } else { x };
        let inside = (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
        if inside { self.values[(channel * height + y as usize) * width + x as usize] } else { 0.0 }
    }
    fn planes(&self, border: Border) -> Planes {
        let [channels, height, width] = self.size;
        let mut planes = Planes::zeros(channels, height, width);
        for (i, &value) in self.values.iter().enumerate() {
            let (channel, y, x) = (i / (height * width), i / width % height, i % width);
            planes.row_mut(channel / LANES, y)[x][channel % LANES] = value;
        }
        planes.fill_border(border);
        planes
    }
    fn of(planes: &Planes) -> Self {
        let size = [planes.channels(), planes.height(), planes.width()];
        let value = |i: usize| {
            let (channel, y, x) = (i / (size[1] * size[2]), i / size[2] % size[1], i % size[2]);
            planes.row(channel / LANES, y)[x][channel % LANES]
        };
        Self { size, values: (0..size.iter().product()).map(value).collect() }
    }
}

struct Case {
    shape: Shape,
    height: usize,
    width: usize,
    border: Border,
}

fn cases() -> Vec<Case> {
    let case =
        |kernel, stride_x, in_channels: &[usize], out_channels, [height, width]: [usize; 2], border, rectify| Case {
            shape: Shape { kernel, stride_x, in_channels: in_channels.to_vec(), out_channels, rectify },
            height,
            width,
            border,
        };
    vec![
        case([3, 3], 1, &[16], 32, [4, 16], Border::Circular, true),
        case([3, 3], 1, &[5], 20, [3, 13], Border::Zero, false),
        case([3, 3], 1, &[20, 35], 70, [12, 40], Border::Circular, true),
        case([3, 3], 1, &[40], 64, [4, 8], Border::Zero, false),
        case([1, 1], 1, &[32, 7], 48, [2, 9], Border::Circular, true),
        case([5, 5], 2, &[20, 3], 17, [5, 22], Border::Circular, true),
        case([5, 5], 1, &[3], 4, [1, 4], Border::Zero, false),
        case([3, 3], 2, &[16], 16, [2, 8], Border::Zero, true),
    ]
}

struct Made {
    sources: Vec<Image>,
    weights: Vec<f32>,
    biases: Vec<f32>,
}

fn make(case: &Case, random: &mut Random) -> Made {
    let shape = &case.shape;
    let sources: Vec<Image> =
        shape.in_channels.iter().map(|&n| Image::random([n, case.height, case.width], random)).collect();
    let n_in: usize = shape.in_channels.iter().sum();
    let n_weights = shape.out_channels * n_in * shape.kernel[0] * shape.kernel[1];
    let weights = (0..n_weights).map(|_| random.between(-0.5, 0.5)).collect();
    let biases = (0..shape.out_channels).map(|_| random.between(-0.5, 0.5)).collect();
    Made { sources, weights, biases }
}

/// The sum in f64, and the sum of the terms' magnitudes, by output channel, row and column.
fn by_definition(case: &Case, made: &Made) -> Vec<(f64, f64)> {
    let shape = &case.shape;
    let [rows, columns] = shape.kernel;
    let n_in: usize = shape.in_channels.iter().sum();
    let mut out = Vec::new();
    for channel in 0..shape.out_channels {
        for y in 0..case.height {
            for x in 0..case.width / shape.stride_x {
                let (mut sum, mut size) = (f64::from(made.biases[channel]), 1.0);
                let mut input = 0;
                for source in &made.sources {
                    for c in 0..source.size[0] {
                        for row in 0..rows {
                            for column in 0..columns {
                                let at_y = y as isize + row as isize - (rows / 2) as isize;
                                let at_x = (x * shape.stride_x) as isize + column as isize - (columns / 2) as isize;
                                let weight = made.weights[((channel * n_in + input) * rows + row) * columns + column];
                                let term = f64::from(weight) * f64::from(source.at(c, at_y, at_x, case.border));
                                sum += term;
                                size += term.abs();
                            }
                        }
                        input += 1;
                    }
                }
                out.push((if shape.rectify { sum.max(0.0) } else { sum }, size));
            }
        }
    }
    out
}

fn run(case: &Case, made: &Made) -> (Filter, Vec<Planes>, Planes) {
    let filter = Filter::new(case.shape.clone(), &made.weights, &made.biases);
    let sources: Vec<Planes> = made.sources.iter().map(|source| source.planes(case.border)).collect();
    let mut out = Planes::zeros(case.shape.out_channels, case.height, case.width / case.shape.stride_x);
    convolve(&filter, &sources.iter().collect::<Vec<_>>(), &mut out);
    (filter, sources, out)
}

#[test]
fn a_convolution_is_its_sum() {
    let mut random = Random(1);
    for case in cases() {
        let made = make(&case, &mut random);
        let (_, _, out) = run(&case, &made);
        let got = Image::of(&out);
        let expected = by_definition(&case, &made);
        assert!(expected.iter().any(|(sum, _)| *sum > 0.1));
        for (got, (sum, size)) in got.values.iter().zip(expected) {
            assert!((f64::from(*got) - sum).abs() < 1e-6 * size, "{:?}: {got} for {sum}", case.shape);
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// <A x, g> = <x, A' g> for a linear map and its derivative: exact up to rounding, for every entry at once.
#[test]
fn derivatives_are_adjoint_to_the_convolution() {
    let mut random = Random(2);
    for mut case in cases() {
        case.shape.rectify = false;
        let made = make(&case, &mut random);
        let (filter, sources, out) = run(&case, &made);
        let gradient = Image::random([out.channels(), out.height(), out.width()], &mut random);
        let gradient_planes = gradient.planes(case.border);
        let total = dot(&Image::of(&out).values, &gradient.values);

        let borrowed: Vec<&Planes> = sources.iter().collect();
        let by_weights = weight_gradient(&case.shape, &borrowed, &gradient_planes);
        assert_eq!(by_weights.len(), case.shape.packed_rows());
        let (by_weights, by_biases) = case.shape.unpacked(&by_weights);
        let from_weights = dot(&by_weights, &made.weights) + dot(&by_biases, &made.biases);
        assert!((from_weights - total).abs() < 1e-4 * (1.0 + total.abs()), "{:?}: {from_weights} {total}", case.shape);

        let of_source = |turned: &Filter| input_gradient(turned, case.shape.stride_x, &gradient_planes, case.border);
        let by_sources: Vec<Planes> = filter.turned().iter().map(of_source).collect();
        let of_biases: f64 = (0..case.shape.out_channels)
            .map(|output| {
                let n = gradient.values.len() / case.shape.out_channels;
                let sum: f64 = gradient.values[output * n..][..n].iter().map(|v| f64::from(*v)).sum();
                sum * f64::from(made.biases[output])
            })
            .sum();
        let from_sources: f64 =
            by_sources.iter().zip(&made.sources).map(|(by, source)| dot(&Image::of(by).values, &source.values)).sum();
        let expected = total - of_biases;
        assert!(
            (from_sources - expected).abs() < 1e-4 * (1.0 + expected.abs()),
            "{:?}: {from_sources} {expected}",
            case.shape
        );
    }
}

#[test]
fn pools_and_upsampling_and_their_derivatives() {
    let mut random = Random(3);
    let image = Image::random([19, 4, 6], &mut random);
    let planes = image.planes(Border::Zero);
    let factor = [2, 3];
    let mut pooled = Planes::zeros(19, 2, 2);
    max_pool(&planes, factor, &mut pooled);
    for channel in 0..19 {
        for y in 0..2 {
            for x in 0..2 {
                let window =
                    (0..6).map(|i| image.at(channel, (y * 2 + i / 3) as isize, (x * 3 + i % 3) as isize, Border::Zero));
                let largest = window.fold(f32::NEG_INFINITY, f32::max);
                assert_eq!(pooled.row(channel / LANES, y)[x][channel % LANES], largest);
            }
        }
    }
    let gradient = Image::random([19, 2, 2], &mut random).planes(Border::Zero);
    let by_image = max_pool_gradient(&planes, &pooled, &gradient, factor);
    let sums = |planes: &Planes| planes.to_inner().iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    assert!((sums(&by_image) - sums(&gradient)).abs() < 1e-5);
    // Each window passes its derivative to its largest element: the sum of the products says so for all windows.
    let products = |a: &Planes, b: &Planes| dot(a.to_inner().as_flattened(), b.to_inner().as_flattened());
    assert!((products(&by_image, &planes) - products(&gradient, &pooled)).abs() < 1e-4);

    let mut large = Planes::zeros(19, 4, 6);
    upsample(&pooled, factor, &mut large);
    let of_large = Image::random([19, 4, 6], &mut random).planes(Border::Zero);
    let of_small = upsample_gradient(&of_large, factor);
    assert!((products(&of_small, &pooled) - products(&of_large, &large)).abs() < 1e-4);
}
