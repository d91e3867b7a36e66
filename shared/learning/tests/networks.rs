//! Networks: derivatives, and what infers beside what learns.

mod support;

use learning::Random;
use learning::engine::{Border, Feature, LANES, Planes};
use learning::network::{Differential, Inference, NetworkSpec, Variables};
use rayon::prelude::*;
use std::collections::BTreeMap;

fn specs() -> [NetworkSpec; 3] {
    [
        NetworkSpec::Unet { inputs: 7, outputs: 5, widths: vec![16, 20, 32], head: None },
        NetworkSpec::Unet { inputs: 7, outputs: 5, widths: vec![16, 20], head: Some(24) },
        NetworkSpec::SphericalDz { inputs: 7, outputs: 5, widths: vec![16, 20] },
    ]
}

const SIZE: [usize; 2] = [8, 16];

fn inputs(random: &mut Random, batch: usize, border: Border) -> Vec<Planes> {
    let mut image = || {
        let mut planes = Planes::zeros(7, SIZE[0], SIZE[1]);
        for y in 0..SIZE[0] {
            planes.row_mut(0, y).iter_mut().flat_map(|pixel| &mut pixel[..7]).for_each(|value| *value = random.gauss());
        }
        planes.fill_border(border);
        planes
    };
    (0..batch).map(|_| image()).collect()
}

#[test]
fn what_infers_gives_what_learned() {
    for spec in specs() {
        for border in [Border::Circular, Border::Zero] {
            let weights = Variables::random(&spec, 7).expect("variables").weights().expect("weights");
            let learning = Differential::new(&spec, &weights, border).expect("fits");
            let inferring = Inference::new(spec.clone(), &weights, border).expect("fits");
            for input in inputs(&mut Random::new(1, 0), 2, border) {
                let by_learning = learning.run(input.clone(), None).expect("runs");
                // Not nearly, exactly: both run the same kernels in the same order.
                assert_eq!(&*inferring.run(&input).expect("runs"), by_learning.result(), "{spec:?}");
            }
        }
    }
}

/// A smooth function of the results with a derivative of its own at every output, and its derivatives by all variables.
fn loss(variables: &Variables, batch: &[Planes]) -> (f64, BTreeMap<String, Vec<f32>>) {
    let weights = variables.weights().expect("weights");
    let network = Differential::new(variables.spec(), &weights, Border::Circular).expect("fits");
    let of_image = |(n, input): (usize, &Planes)| {
        let recording = network.run(input.clone(), None).expect("runs");
        let result = recording.result();
        let mut by_result = Planes::zeros(result.channels(), result.height(), result.width());
        let mut sum = 0.0;
        for y in 0..result.height() {
            for (x, (pixel, by)) in result.row(0, y).iter().zip(by_result.row_mut(0, y)).enumerate() {
                for lane in 0..result.channels() {
                    let factor = ((((n * SIZE[0] + y) * SIZE[1] + x) * LANES + lane) as f32 * 0.37).sin();
                    let value = pixel[lane].tanh();
                    sum += f64::from(factor * value);
                    by[lane] = factor * (1.0 - value * value);
                }
            }
        }
        (sum, network.derive(&recording, by_result))
    };
    let of_images: Vec<(f64, Vec<Vec<Feature>>)> =
        batch.par_iter().enumerate().map(|(n, i)| of_image((n, i))).collect();
    let mut sums: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    for (_, by_filters) in &of_images {
        for (name, gradient) in variables.gradients(by_filters).expect("derives") {
            let sum = sums.entry(name).or_insert_with(|| vec![0.0; gradient.len()]);
            sum.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += value);
        }
    }
    (of_images.iter().map(|(sum, _)| sum).sum(), sums)
}

#[test]
fn derivatives_by_every_variable_are_those_of_finite_differences() {
    for spec in specs() {
        let variables = Variables::random(&spec, 3).expect("variables");
        let batch = inputs(&mut Random::new(2, 0), 2, Border::Circular);
        let (_, gradients) = loss(&variables, &batch);
        for (stream, (name, var)) in variables.iter().enumerate() {
            let shape = var.shape().clone();
            let values = var.flatten_all().expect("flat").to_vec1::<f32>().expect("f32");
            let mut random = Random::new(5, stream as u64);
            // Steps as long for filters, which are standardized, as for the others.
            let fan_in = shape.dims()[1..].iter().product::<usize>() as f32;
            let scale = fan_in.sqrt();
            let direction: Vec<f32> = values.iter().map(|_| random.gauss() / scale).collect();
            let gradient = gradients.get(name).unwrap_or_else(|| panic!("{name} has no derivative"));
            let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(g * d)).sum();
            let size: f64 = gradient.iter().map(|g| f64::from(g / scale).powi(2)).sum::<f64>().sqrt();
            let moved = |by: f32| {
                let values = values.iter().zip(&direction).map(|(v, d)| v + by * d).collect();
                variables.set(name, values, shape.dims()).expect("sets");
                loss(&variables, &batch).0
            };
            let off = |step: f32| {
                let difference = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
                (difference - along).abs()
            };
            // f32 holds seven digits, which tells on the short step, and rectifiers bend between the two places, which tells on
            // the long one: one of them must come near, to a few percent of the derivative's size.
            let error = off(5e-5).min(off(2e-4));
            moved(0.0);
            assert!(size > 1e-3, "{name} of {spec:?} has no derivative");
            assert!(error < 0.02 * size + 0.05, "{name} of {spec:?}: {along} is off by {error}, size {size}");
        }
    }
}

#[test]
fn layers_of_another_network_are_taken_over_where_they_fit() {
    let [of, wider, _] = specs();
    let weights = Variables::random(&of, 1).expect("variables").weights().expect("weights");
    let variables = Variables::random(&wider, 2).expect("variables");
    // Both levels down, and the 1 x 1 convolution up to the finest level is of another width.
    assert_eq!(variables.begin_with(&weights).expect("fits"), 5);
    let taken = variables.weights().expect("weights");
    let nearly = |name: &str| {
        let pairs = taken.tensors[name].1.iter().zip(&weights.tensors[name].1);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1e-5
    };
    assert!(nearly("down.1.1.weight") && !nearly("up.0.1.weight"));
}

#[test]
fn weights_become_variables_that_give_them_back() {
    let spec = &specs()[0];
    let weights = Variables::random(spec, 11).expect("variables").weights().expect("weights");
    let again = Variables::from_weights(spec, &weights).expect("fits").weights().expect("weights");
    for (name, (shape, values)) in &weights.tensors {
        let (again_shape, again_values) = &again.tensors[name];
        assert_eq!(shape, again_shape);
        for (a, b) in values.iter().zip(again_values) {
            assert!((a - b).abs() < 1e-5, "{name}: {a} {b}");
        }
    }
}
