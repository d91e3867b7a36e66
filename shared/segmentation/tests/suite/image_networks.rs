//! Networks on images: kernels against operations of candle.

use candle_core::{Device, Tensor};
use kernels::images::tensors::zeros;
use kernels::images::{Border, Planes};
use random::Random;
use segmentation::network::{Inference, NetworkSpec, TensorShape, WeightTensor, Weights};
use segmentation::{ComputeDevice, Options, SegmentationError};

const BORDERS: [Border; 2] = [Border::Circular, Border::Zero];

fn image(size: [usize; 3], border: Border, random: &mut Random) -> Planes {
    Planes::from_fn(size, border, |_, _, _| random.range(-1.0, 1.0))
}

/// Networks whose numbers of channels do not fill their blocks, and one whose number does.
fn specs() -> [NetworkSpec; 4] {
    [
        NetworkSpec::Unet { inputs: 7, outputs: 5, widths: vec![16, 20, 35], head: None },
        NetworkSpec::Unet { inputs: 20, outputs: 33, widths: vec![17, 32], head: Some(24) },
        NetworkSpec::SphericalDz { inputs: 7, outputs: 5, widths: vec![16, 21, 33] },
        NetworkSpec::SphericalDz { inputs: 20, outputs: 19, widths: vec![19] },
    ]
}

/// Random weights that keep the variance of the images, and random biases.
fn weights(spec: &NetworkSpec, random: &mut Random) -> Weights {
    let mut weights = Weights::default();
    for layer in spec.layers() {
        for TensorShape { name, shape } in layer.tensors() {
            let n_in: usize = shape[1..].iter().product();
            let values = (0..shape.iter().product()).map(|_| random.gauss() / (n_in as f32).sqrt()).collect();
            weights.tensors.insert(name, WeightTensor { shape, values });
        }
    }
    weights
}

#[test]
fn networks_on_operations_of_candle_give_outputs_of_kernels() {
    let mut random = Random::new(1);
    for (spec, border) in specs().iter().flat_map(|spec| BORDERS.map(|border| (spec, border))) {
        let weights = weights(spec, &mut random);
        let kernels = Inference::new(spec.clone(), &weights, border).expect("fits");
        let features = Inference::feature_extractor(spec.clone(), &weights, border).expect("fits");
        // The last image has another size: it cannot be in one tensor with the others.
        let images = [[8, 16], [8, 16], [8, 16], [16, 24]].map(|[height, width]| {
            image([spec.inputs(), height, width], border, &mut random).to_tensor().expect("an image")
        });
        let images: Vec<&Tensor> = images.iter().collect();
        for network in [kernels, features] {
            let expected: Vec<Planes> = images.iter().map(|image| output(&network, image)).collect();
            let n_channels = network.out_channels();
            let on_device = network.on_device(Device::Cpu).expect("fits");
            let got = on_device.run_batch(&images).expect("runs");
            assert_eq!(got.len(), images.len());
            for (got, expected) in got.iter().zip(expected) {
                let got = Planes::from_tensor(got, n_channels).expect("an image");
                assert_eq!((got.height(), got.width()), (expected.height(), expected.width()));
                let largest = expected.values().iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
                assert!(largest > 0.1, "{spec:?}");
                // Borders included.
                for (got, expected) in got.values().iter().zip(expected.values()) {
                    assert!((got - expected).abs() < 1e-4 * largest, "{got} for {expected}, {spec:?}, {border:?}");
                }
            }
        }
    }
}

fn output(network: &Inference, image: &Tensor) -> Planes {
    Planes::from_tensor(&network.run(image).expect("runs"), network.out_channels()).expect("an image")
}

#[test]
fn outputs_of_a_batch_are_those_of_single_images_for_any_number_of_threads() {
    let mut random = Random::new(2);
    for spec in specs() {
        let weights = weights(&spec, &mut random);
        let images: Vec<Tensor> = (0..5)
            .map(|_| image([spec.inputs(), 8, 16], Border::Circular, &mut random).to_tensor().expect("an image"))
            .collect();
        let images: Vec<&Tensor> = images.iter().collect();
        let fresh = || Inference::new(spec.clone(), &weights, Border::Circular).expect("fits");
        let expected: Vec<Planes> = images.iter().map(|image| output(&fresh(), image)).collect();
        for n_threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
            let network = fresh();
            // The second round writes to the images of the first one.
            for _ in 0..2 {
                let outputs = pool.install(|| network.run_batch(&images)).expect("runs");
                for (got, expected) in outputs.iter().zip(&expected) {
                    assert_eq!(&Planes::from_tensor(got, network.out_channels()).expect("an image"), expected);
                }
            }
        }
    }
}

#[test]
fn input_that_does_not_fit_the_network_is_refused() {
    let spec = &specs()[0];
    let network = Inference::new(spec.clone(), &weights(spec, &mut Random::new(5)), Border::Circular).expect("fits");
    let found = |size: [usize; 3]| match network.run(&zeros(size[0], size[1], size[2]).expect("memory")) {
        Err(SegmentationError::InputSize { found, .. }) => Some(found),
        _ => None,
    };
    assert_eq!(found([7, 8, 8]), None);
    assert_eq!(found([7, 8, 10]), Some([1, 8, 10]));
    assert_eq!(found([7, 6, 8]), Some([1, 6, 8]));
    assert_eq!(found([17, 8, 8]), Some([2, 8, 8]));
    // The coarsest level has one column, fewer than its border.
    assert!(matches!(network.run(&zeros(7, 8, 4).expect("memory")), Err(SegmentationError::Compute(_))));
}

#[test]
fn gpu_without_cuda_is_refused_with_the_command_that_builds_it() {
    assert!(ComputeDevice::Cpu.open().expect("always there").is_none());
    assert_eq!(Options::default().device, ComputeDevice::Cpu);
    match ComputeDevice::Cuda.open() {
        Err(SegmentationError::BuiltWithoutCuda) => {
            let text = SegmentationError::BuiltWithoutCuda.to_string();
            assert!(text.contains("cargo build --release -p infer -p replica_lab --features cuda"), "{text}");
        }
        other => assert!(candle_core::utils::cuda_is_available(), "{other:?}"),
    }
}
