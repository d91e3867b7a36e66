//! Convolution, pooling and upsampling compared with their definitions.

use kernels::images::{Border, Filter, LANES, Planes, Shape, convolve, max_pool, upsample};
use random::Random;

/// Values by channel, row and column.
struct Image {
    size: [usize; 3],
    values: Vec<f32>,
}

impl Image {
    fn random(size: [usize; 3], random: &mut Random) -> Self {
        Self { size, values: (0..size.iter().product()).map(|_| random.range(-1.0, 1.0)).collect() }
    }
    fn at(&self, channel: usize, y: isize, x: isize, border: Border) -> f32 {
        let [_, height, width] = self.size;
        let x = if border == Border::Circular { x.rem_euclid(width as isize) } else { x };
        let inside = (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
        if inside { self.values[(channel * height + y as usize) * width + x as usize] } else { 0.0 }
    }
    fn planes(&self, border: Border) -> Planes {
        let mut values = self.values.iter();
        Planes::from_fn(self.size, border, |_, _, _| *values.next().expect("one for each pixel"))
    }
    fn from_planes(planes: &Planes) -> Self {
        let size = [planes.channels(), planes.height(), planes.width()];
        let value = |i: usize| {
            let channel = i / (size[1] * size[2]);
            let y = i / size[2] % size[1];
            let x = i % size[2];
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

struct Operands {
    sources: Vec<Image>,
    weights: Vec<f32>,
    biases: Vec<f32>,
}

fn make(case: &Case, random: &mut Random) -> Operands {
    let shape = &case.shape;
    let sources: Vec<Image> =
        shape.in_channels.iter().map(|&n| Image::random([n, case.height, case.width], random)).collect();
    let n_in: usize = shape.in_channels.iter().sum();
    let n_weights = shape.out_channels * n_in * shape.kernel[0] * shape.kernel[1];
    let weights = (0..n_weights).map(|_| random.range(-0.5, 0.5)).collect();
    let biases = (0..shape.out_channels).map(|_| random.range(-0.5, 0.5)).collect();
    Operands { sources, weights, biases }
}

/// The sum in f64, and the sum of the terms' magnitudes, by output channel, row and column.
fn by_definition(case: &Case, made: &Operands) -> Vec<(f64, f64)> {
    let shape = &case.shape;
    let [rows, columns] = shape.kernel;
    let n_in: usize = shape.in_channels.iter().sum();
    let mut out = Vec::new();
    for channel in 0..shape.out_channels {
        for y in 0..case.height {
            for x in 0..case.width / shape.stride_x {
                let mut sum = f64::from(made.biases[channel]);
                let mut size = 1.0;
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

fn run(case: &Case, made: &Operands) -> Planes {
    let filter = Filter::new(case.shape.clone(), &made.weights, &made.biases);
    let sources: Vec<Planes> = made.sources.iter().map(|source| source.planes(case.border)).collect();
    let mut out = Planes::zeros(case.shape.out_channels, case.height, case.width / case.shape.stride_x);
    convolve(&filter, &sources.iter().collect::<Vec<_>>(), &mut out);
    out
}

#[test]
fn convolution_equals_sum_of_products() {
    let mut random = Random::new(1);
    for case in cases() {
        let made = make(&case, &mut random);
        let out = run(&case, &made);
        let got = Image::from_planes(&out);
        let expected = by_definition(&case, &made);
        assert!(expected.iter().any(|(sum, _)| *sum > 0.1));
        for (got, (sum, size)) in got.values.iter().zip(expected) {
            assert!((f64::from(*got) - sum).abs() < 1e-6 * size, "{:?}: {got} for {sum}", case.shape);
        }
    }
}

#[test]
fn max_pool_takes_maximum_of_each_window_and_upsample_repeats_pixels() {
    let mut random = Random::new(3);
    let image = Image::random([19, 4, 6], &mut random);
    let planes = image.planes(Border::Zero);
    let mut pooled = Planes::zeros(19, 2, 2);
    let mut large = Planes::zeros(19, 4, 6);
    max_pool(&planes, [2, 3], &mut pooled);
    upsample(&pooled, [2, 3], &mut large);
    for channel in 0..19 {
        for y in 0..4 {
            for x in 0..6 {
                let window = (0..6).map(|i| {
                    let y = y / 2 * 2 + i / 3;
                    let x = x / 3 * 3 + i % 3;
                    image.at(channel, y as isize, x as isize, Border::Zero)
                });
                let largest = window.fold(f32::NEG_INFINITY, f32::max);
                assert_eq!(pooled.row(channel / LANES, y / 2)[x / 3][channel % LANES], largest);
                assert_eq!(large.row(channel / LANES, y)[x][channel % LANES], largest);
            }
        }
    }
}
