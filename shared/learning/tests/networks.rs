//! Networks: the tape's derivatives, and the engine's results beside the tape's.

mod support;

use candle_core::{Device, Tensor};
use learning::Random;
use learning::engine::{Border, LANES, Planes};
use learning::network::{Inference, NetworkSpec, Tape, Variables};

fn specs() -> [NetworkSpec; 2] {
    [
        NetworkSpec::Unet { inputs: 7, outputs: 5, widths: vec![16, 20, 32] },
        NetworkSpec::SphericalDz { inputs: 7, outputs: 5, widths: vec![16, 20] },
    ]
}

const SIZE: [usize; 2] = [8, 16];

fn input(random: &mut Random, batch: usize) -> Tensor {
    let [height, width] = SIZE;
    let values: Vec<f32> =
        (0..batch * height * width * LANES).map(|i| if i % LANES < 7 { random.gauss() } else { 0.0 }).collect();
    Tensor::from_vec(values, (batch, 1, height, width, LANES), &Device::Cpu).expect("an image")
}

#[test]
fn the_engine_gives_what_the_tape_gives() {
    for spec in specs() {
        for border in [Border::Circular, Border::Zero] {
            let variables = Variables::random(&spec, 7).expect("variables");
            let batch = input(&mut Random::new(1, 0), 2);
            let by_tape = Tape::new(&variables, border, None).run(batch.clone()).expect("runs");
            let engine = Inference::new(spec.clone(), &variables.weights().expect("weights"), border).expect("fits");
            for index in 0..2 {
                let inner =
                    batch.get(index).expect("an image").flatten_all().expect("flat").to_vec1::<f32>().expect("f32");
                let planes = Planes::from_inner(7, SIZE[0], SIZE[1], inner.as_chunks::<LANES>().0, border);
                let by_engine = engine.run(planes).expect("runs").to_inner();
                let by_tape =
                    by_tape.get(index).expect("an image").flatten_all().expect("flat").to_vec1::<f32>().expect("f32");
                // Not nearly, exactly: both run the same kernels in the same order.
                assert_eq!(by_engine.as_flattened(), by_tape, "{spec:?}");
            }
        }
    }
}

#[test]
fn derivatives_by_every_variable_are_those_of_finite_differences() {
    for spec in specs() {
        let variables = Variables::random(&spec, 3).expect("variables");
        let batch = input(&mut Random::new(2, 0), 2);
        let loss = || {
            let out = Tape::new(&variables, Border::Circular, None).run(batch.clone()).expect("runs");
            // A smooth function with a derivative of its own at every output.
            let n = out.elem_count();
            let factors: Vec<f32> = (0..n).map(|i| ((i as f32) * 0.37).sin()).collect();
            let factors = Tensor::from_vec(factors, out.shape(), &Device::Cpu).expect("factors");
            out.tanh().and_then(|out| out * factors).and_then(|out| out.sum_all()).expect("a number")
        };
        let gradients = loss().backward().expect("derives");
        for (stream, (name, var)) in variables.iter().enumerate() {
            let shape = var.shape().clone();
            let values = var.flatten_all().expect("flat").to_vec1::<f32>().expect("f32");
            let mut random = Random::new(5, stream as u64);
            let direction: Vec<f32> = values.iter().map(|_| random.gauss()).collect();
            let gradient = gradients.get(var).unwrap_or_else(|| panic!("{name} has no derivative"));
            let gradient = gradient.flatten_all().expect("flat").to_vec1::<f32>().expect("f32");
            let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(g * d)).sum();
            let size: f64 = gradient.iter().map(|g| f64::from(g * g)).sum::<f64>().sqrt();
            let moved = |by: f32| {
                let values = values.iter().zip(&direction).map(|(v, d)| v + by * d).collect();
                variables.set(name, values, shape.dims()).expect("sets");
                f64::from(loss().to_scalar::<f32>().expect("a number"))
            };
            let step = 2e-4;
            let difference = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
            moved(0.0);
            // Rectifiers bend between the two places, and f32 holds seven digits: a few percent of the derivative's size.
            assert!(size > 1e-3, "{name} of {spec:?} has no derivative");
            let error = (difference - along).abs();
            assert!(error < 0.02 * size + 0.05, "{name} of {spec:?}: {along} for {difference}, size {size}");
        }
    }
}

#[test]
fn threads_do_not_show_in_derivatives() {
    let spec = &specs()[0];
    let variables = Variables::random(spec, 3).expect("variables");
    let batch = input(&mut Random::new(2, 0), 4);
    let derivative = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let out = Tape::new(&variables, Border::Circular, None).run(batch.clone()).expect("runs");
            let gradients = out.sqr().and_then(|out| out.sum_all()).and_then(|loss| loss.backward()).expect("derives");
            let flat = |var: &candle_core::Var| gradients.get(var).expect("one").flatten_all().expect("flat");
            variables.iter().map(|(_, var)| flat(var).to_vec1::<f32>().expect("f32")).collect::<Vec<_>>()
        })
    };
    assert!(derivative(1) == derivative(3));
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
