//! Derivatives of whole networks, compared with central differences of a reference in f64.

use crate::reference::{self, Image, Values, values_of};
use kernels::images::{Border, LANES, Planes};
use random::Random;
use rayon::prelude::*;
use segmentation::network::NetworkSpec;
use std::collections::BTreeMap;
use training::{Differential, Variables};

/// Largest allowed error of a directional derivative, relative to the norm of the derivative. Rounding in f32 causes about 1e-5.
pub const MAX_ERROR: f64 = 1e-3;

/// Step of central differences, relative to the norm of the variable: truncation and rounding in f64 are far below the bound, and
/// hardly any rectifier changes its sign.
const STEP: f64 = 1e-8;

/// Random directions per variable, in addition to the derivative itself.
const N_DIRECTIONS: usize = 3;

const CHANNELS: usize = 7;
const SIZE: [usize; 2] = [8, 16];

type Gradients = BTreeMap<String, Vec<f32>>;

fn specs() -> [NetworkSpec; 3] {
    [
        NetworkSpec::Unet { inputs: CHANNELS, outputs: 5, widths: vec![16, 20, 32], head: None },
        NetworkSpec::Unet { inputs: CHANNELS, outputs: 5, widths: vec![16, 20], head: Some(24) },
        NetworkSpec::SphericalDz { inputs: CHANNELS, outputs: 5, widths: vec![16, 20] },
    ]
}

/// Random inputs that f32 and f64 represent exactly.
fn inputs() -> Vec<Image> {
    let mut random = Random::for_stream(2, 0);
    let mut input = || {
        let mut image = Image::zeros(CHANNELS, SIZE[0], SIZE[1]);
        image.values.iter_mut().for_each(|value| *value = f64::from(random.gauss()));
        image
    };
    (0..2).map(|_| input()).collect()
}

/// Weight of an output value in the loss: each output has its own derivative.
fn weight(example: usize, y: usize, x: usize, channel: usize) -> f64 {
    ((((example * SIZE[0] + y) * SIZE[1] + x) * LANES + channel) as f64 * 0.37).sin()
}

/// The loss in f64: the weighted sum of tanh of all outputs.
fn reference_loss(spec: &NetworkSpec, values: &Values, inputs: &[Image]) -> f64 {
    let of_example = |(example, input): (usize, &Image)| {
        let output = reference::run(spec, values, input.clone());
        let mut sum = 0.0;
        for channel in 0..output.channels {
            for y in 0..output.height {
                for x in 0..output.width {
                    sum += weight(example, y, x, channel) * output.values[output.index(channel, y, x)].tanh();
                }
            }
        }
        sum
    };
    inputs.iter().enumerate().map(of_example).sum()
}

/// The derivatives of the loss with respect to all variables, computed by the crate.
fn gradients(variables: &Variables, inputs: &[Image]) -> Gradients {
    let weights = variables.weights().expect("weights");
    let network = Differential::new(variables.spec(), &weights, Border::Circular).expect("fits");
    let mut sums = Gradients::new();
    for (example, input) in inputs.iter().enumerate() {
        let value = |channel, y, x| input.values[input.index(channel, y, x)] as f32;
        let planes = Planes::from_fn([CHANNELS, SIZE[0], SIZE[1]], Border::Circular, value);
        let recording = network.run(planes, None).expect("runs");
        let output = recording.output();
        let mut by_output = Planes::zeros(output.channels(), output.height(), output.width());
        for y in 0..output.height() {
            for (x, (pixel, by)) in output.row(0, y).iter().zip(by_output.row_mut(0, y)).enumerate() {
                for channel in 0..output.channels() {
                    let value = pixel[channel].tanh();
                    by[channel] = weight(example, y, x, channel) as f32 * (1.0 - value * value);
                }
            }
        }
        let by_filters = network.backward(&recording, by_output);
        let layers = variables.spec().layers();
        let of_layers = layers.iter().zip(&by_filters).map(|(layer, packed)| layer.shape.unpacked(packed)).collect();
        for (name, gradient) in variables.gradients(of_layers).expect("differentiates") {
            let sum = sums.entry(name).or_insert_with(|| vec![0.0; gradient.len()]);
            sum.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += value);
        }
    }
    sums
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Largest error of the derivatives of one variable along its gradient and random directions, relative to the norm of the gradient.
pub fn relative_error(loss: impl Fn(&Values) -> f64 + Sync, values: &Values, name: &str, gradient: &[f32]) -> f64 {
    let gradient: Vec<f64> = gradient.iter().map(|g| f64::from(*g)).collect();
    let size = norm(&gradient);
    assert!(size > 1e-3, "{name}: derivative of norm {size}");
    let mut random = Random::new(name.bytes().fold(5, |seed, byte| random::hash(seed, u64::from(byte))));
    let mut directions = vec![gradient.clone()];
    directions.extend((0..N_DIRECTIONS).map(|_| gradient.iter().map(|_| f64::from(random.gauss())).collect()));
    let error = |direction: &Vec<f64>| {
        let length = norm(direction);
        let direction: Vec<f64> = direction.iter().map(|d| d / length).collect();
        let size_of_step = STEP * norm(&values[name]).max(1.0);
        let loss_at = |step: f64| {
            let mut moved = values.clone();
            let variable = moved.get_mut(name).expect("is there");
            variable.iter_mut().zip(&direction).for_each(|(value, d)| *value += step * d);
            loss(&moved)
        };
        let difference = (loss_at(size_of_step) - loss_at(-size_of_step)) / (2.0 * size_of_step);
        let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        (difference - along).abs() / size
    };
    directions.par_iter().map(error).reduce(|| 0.0, f64::max)
}

#[test]
fn derivatives_of_all_variables_equal_central_differences_in_f64() {
    for spec in specs() {
        let variables = Variables::random(&spec, 3).expect("variables");
        let values = values_of(&variables);
        let inputs = inputs();
        let gradients = gradients(&variables, &inputs);
        let mut largest = 0.0_f64;
        for (name, _) in variables.iter() {
            let gradient = gradients.get(name).unwrap_or_else(|| panic!("{name} of {spec:?} has no derivative"));
            let error = relative_error(|values| reference_loss(&spec, values, &inputs), &values, name, gradient);
            assert!(error < MAX_ERROR, "{name} of {spec:?}: relative error {error:.1e}");
            largest = largest.max(error);
        }
        println!("largest relative error {largest:.1e} of {spec:?}");
    }
}

/// The check detects the errors that it is designed for: a scaled derivative, and an error of some percent in one output
/// channel.
#[test]
fn derivative_check_detects_planted_errors_of_a_few_percent() {
    let spec = &specs()[1];
    let variables = Variables::random(spec, 3).expect("variables");
    let values = values_of(&variables);
    let inputs = inputs();
    let gradients = gradients(&variables, &inputs);
    for name in ["down.0.0.raw", "up.0.1.raw", "classes.bias", "down.1.1.gain"] {
        let gradient = &gradients[name];
        let scaled: Vec<f32> = gradient.iter().map(|g| 1.03 * g).collect();
        let mut one_channel = gradient.clone();
        let n = gradient.len() / values[&name.replace(".raw", ".gain")].len();
        let square = |channel: &&mut [f32]| channel.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>();
        let largest = one_channel.chunks_mut(n).max_by(|a, b| square(a).total_cmp(&square(b))).expect("not empty");
        for g in largest {
            *g *= 1.05;
        }
        for planted in [scaled, one_channel] {
            let error = relative_error(|values| reference_loss(spec, values, &inputs), &values, name, &planted);
            assert!(error > MAX_ERROR, "{name}: a planted error gives only {error:.1e}");
        }
    }
}
