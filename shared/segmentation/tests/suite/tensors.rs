//! Images in tensors, kernels as operations of candle, and networks on the operations of candle.

use candle_core::{Device, Tensor};
use random::Random;
use segmentation::engine::ops::{Convolution, MaxPool, Upsample};
use segmentation::engine::tensors::{FromBlocks, ToBlocks, read_image, size_of_image, zeros};
use segmentation::engine::{Border, Filter, LANES, Planes, Shape};
use segmentation::network::{Inference, NetworkSpec, Weights};
use segmentation::{ComputeDevice, Options, SegmentationError};

const BORDERS: [Border; 2] = [Border::Circular, Border::Zero];

fn image(size: [usize; 3], border: Border, random: &mut Random) -> Planes {
    Planes::from_fn(size, border, |_, _, _| random.range(-1.0, 1.0))
}

/// Networks with numbers of channels that do not fill their blocks, and with one that does.
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
        for (name, shape) in layer.tensors() {
            let n_in: usize = shape[1..].iter().product();
            let values = (0..shape.iter().product()).map(|_| random.gauss() / (n_in as f32).sqrt()).collect();
            weights.tensors.insert(name, (shape, values));
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
        let features = Inference::of_features(spec.clone(), &weights, border).expect("fits");
        // The last image has another size: it cannot be in one tensor with the others.
        let images = [[8, 16], [8, 16], [8, 16], [16, 24]].map(|[height, width]| {
            image([spec.channels().0, height, width], border, &mut random).to_tensor().expect("an image")
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
            .map(|_| image([spec.channels().0, 8, 16], Border::Circular, &mut random).to_tensor().expect("an image"))
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
fn image_converts_to_order_of_pytorch_and_back() {
    let mut random = Random::new(3);
    for (channels, border) in [1, 16, 37].into_iter().flat_map(|channels| BORDERS.map(|border| (channels, border))) {
        let planes = image([channels, 3, 5], border, &mut random);
        let tensor = planes.to_tensor().expect("an image");
        assert_eq!(size_of_image(&tensor).expect("an image"), [3, 5]);
        let ordered = tensor.apply_op1_no_bwd(&FromBlocks { channels }).expect("an image");
        assert_eq!(ordered.dims(), [1, channels, 3, 5]);
        let values = ordered.squeeze(0).and_then(|values| values.to_vec3::<f32>()).expect("values");
        for (channel, of_channel) in values.iter().enumerate() {
            for (y, row) in of_channel.iter().enumerate() {
                let pixels = planes.row(channel / LANES, y).iter().map(|pixel| pixel[channel % LANES]);
                assert!(pixels.eq(row.iter().copied()), "channel {channel}, row {y}");
            }
        }
        let back = ordered.apply_op1_no_bwd(&ToBlocks { border }).expect("an image");
        assert_eq!(Planes::from_tensor(&back, channels).expect("an image"), planes);
    }
}

/// `relu` of candle after a convolution gives the bits of the rectifier of the kernel, as do a sum and a product.
#[test]
fn operations_of_candle_stand_between_kernels() {
    let mut random = Random::new(4);
    let shape = |rectify| Shape { kernel: [3, 3], stride_x: 1, in_channels: vec![5], out_channels: 20, rectify };
    let weights: Vec<f32> = (0..20 * 5 * 9).map(|_| random.range(-1.0, 1.0)).collect();
    let [plain, rectified] = [false, true].map(|rectify| Filter::new(shape(rectify), &weights, &[0.0; 20]));
    let source = image([5, 8, 12], Border::Circular, &mut random).to_tensor().expect("an image");
    let convolved = |filter: &Filter| {
        let out = zeros(20, 8, 12).expect("memory");
        out.inplace_op2(&source, &Convolution { filter, border: Border::Circular }).expect("fits");
        out
    };
    let values = |tensor: &Tensor| tensor.flatten_all().and_then(|values| values.to_vec1::<f32>()).expect("values");
    let by_candle = convolved(&plain).relu().expect("runs");
    assert_eq!(values(&by_candle), values(&convolved(&rectified)));
    let twice = (&by_candle + &by_candle).expect("runs");
    let pooled = zeros(20, 4, 6).expect("memory");
    pooled.inplace_op2(&twice, &MaxPool { factor: [2, 2], border: Border::Circular }).expect("fits");
    let expected = zeros(20, 4, 6).expect("memory");
    expected.inplace_op2(&by_candle, &MaxPool { factor: [2, 2], border: Border::Circular }).expect("fits");
    assert_eq!(values(&pooled), values(&(expected * 2.0).expect("runs")));
}

#[test]
fn tensors_of_wrong_size_are_refused() {
    let shape = Shape { kernel: [3, 3], stride_x: 2, in_channels: vec![5, 20], out_channels: 9, rectify: true };
    let filter = Filter::new(shape, &[0.0; 9 * 25 * 9], &[0.0; 9]);
    let border = Border::Circular;
    let convolution = Convolution { filter: &filter, border };
    let (few, many, out) = (zeros(5, 4, 8).expect("memory"), zeros(20, 4, 8).expect("memory"), zeros(9, 4, 4));
    let (out, small) = (out.expect("memory"), zeros(5, 4, 6).expect("memory"));
    out.inplace_op3(&few, &many, &convolution).expect("fits");
    assert!(out.inplace_op2(&few, &convolution).is_err(), "one source is missing");
    assert!(out.inplace_op3(&many, &few, &convolution).is_err(), "the sources are exchanged");
    assert!(out.inplace_op3(&small, &many, &convolution).is_err(), "the sources differ in size");
    assert!(few.inplace_op3(&small, &many, &convolution).is_err(), "the output is too large");
    let of_factor = |factor| out.inplace_op2(&few, &MaxPool { factor, border });
    of_factor([1, 2]).expect("fits");
    assert!(of_factor([2, 2]).is_err(), "rows do not match");
    few.inplace_op2(&out, &Upsample { factor: [1, 2], border }).expect("fits");
    assert!(few.inplace_op2(&out, &Upsample { factor: [1, 3], border }).is_err(), "columns do not match");
    assert!(many.inplace_op2(&out, &Upsample { factor: [1, 2], border }).is_err(), "blocks do not match");
    let narrow = zeros(5, 4, 1).expect("memory");
    assert!(narrow.inplace_op2(&few, &MaxPool { factor: [1, 8], border }).is_err(), "narrower than its border");

    let flat = Tensor::zeros(7, candle_core::DType::F32, &Device::Cpu).expect("memory");
    assert!(size_of_image(&flat).is_err() && out.inplace_op2(&flat, &MaxPool { factor: [1, 1], border }).is_err());
    assert!(read_image(&out, 17, |_| ()).is_err(), "17 channels have two blocks");
    assert!(read_image(&out.t().expect("a view"), 9, |_| ()).is_err(), "lanes are not last");
    let integers = out.to_dtype(candle_core::DType::U32).expect("converts");
    assert!(read_image(&integers, 9, |_| ()).is_err(), "integers");
    assert!(integers.inplace_op2(&few, &MaxPool { factor: [1, 2], border }).is_err(), "integers");
    assert!(
        flat.apply_op1_no_bwd(&ToBlocks { border }).is_err()
            && flat.apply_op1_no_bwd(&FromBlocks { channels: 7 }).is_err()
    );
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
            assert!(text.contains("cargo build --release -p infer -p replica --features cuda"), "{text}");
        }
        other => assert!(candle_core::utils::cuda_is_available(), "{other:?}"),
    }
}
