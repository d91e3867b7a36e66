//! Variables, their weights, and the agreement of training with inference.

use kernels::images::{Border, Planes};
use random::Random;
use segmentation::network::{Inference, NetworkSpec};
use training::{Differential, Variables};

fn specs() -> [NetworkSpec; 3] {
    [
        NetworkSpec::Unet { inputs: 7, outputs: 5, widths: vec![16, 20, 32], head: None },
        NetworkSpec::Unet { inputs: 7, outputs: 5, widths: vec![16, 20], head: Some(24) },
        NetworkSpec::SphericalDz { inputs: 7, outputs: 5, widths: vec![16, 20] },
    ]
}

fn input(random: &mut Random, border: Border) -> Planes {
    Planes::from_fn([7, 8, 16], border, |_, _, _| random.gauss())
}

#[test]
fn inference_gives_the_bits_of_training() {
    for spec in specs() {
        for border in [Border::Circular, Border::Zero] {
            let weights = Variables::random(&spec, 7).expect("variables").weights().expect("weights");
            let differential = Differential::new(&spec, &weights, border).expect("fits");
            let inference = Inference::new(spec.clone(), &weights, border).expect("fits");
            let mut random = Random::for_stream(1, 0);
            for input in [input(&mut random, border), input(&mut random, border)] {
                let recording = differential.run(input.clone(), None).expect("runs");
                // Exact equality, because both run the same kernels in the same order.
                let output = inference.run(&input.to_tensor().expect("an image")).expect("runs");
                let output = Planes::from_tensor(&output, inference.out_channels()).expect("an image");
                assert_eq!(&output, recording.output(), "{spec:?}");
            }
        }
    }
}

#[test]
fn layers_of_another_network_initialize_matching_layers() {
    let [of, wider, _] = specs();
    let weights = Variables::random(&of, 1).expect("variables").weights().expect("weights");
    let variables = Variables::random(&wider, 2).expect("variables");
    // Both levels of the encoder, and the 1 x 1 convolution to the finest level. The last 3 x 3 convolution has another width.
    assert_eq!(variables.begin_with(&weights).expect("fits"), 5);
    let taken = variables.weights().expect("weights");
    let nearly = |name: &str| {
        let pairs = taken.tensors[name].values.iter().zip(&weights.tensors[name].values);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1e-5
    };
    assert!(nearly("down.1.1.weight") && !nearly("up.0.1.weight"));
}

#[test]
fn variables_from_weights_give_the_same_weights() {
    let spec = &specs()[0];
    let weights = Variables::random(spec, 11).expect("variables").weights().expect("weights");
    let again = Variables::from_weights(spec, &weights).expect("fits").weights().expect("weights");
    for (name, tensor) in &weights.tensors {
        let again = &again.tensors[name];
        assert_eq!(tensor.shape, again.shape);
        for (a, b) in tensor.values.iter().zip(&again.values) {
            assert!((a - b).abs() < 1e-5, "{name}: {a} {b}");
        }
    }
}
