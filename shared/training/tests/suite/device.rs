//! Derivatives computed by candle operations equal the derivatives of the kernels.

use candle_core::Device;
use kernels::images::{Border, Planes};
use random::Random;
use segmentation::network::NetworkSpec;
use training::{Criterion, Example, Hierarchy, ImageNetwork, Loss, Network, SparseView, UNKNOWN, Variables};

const CLASSES: usize = 3;
const FOLD: usize = 2;

/// Noise; one in five pixels has no class. Every second row is also in a sparse view.
fn example(size: [usize; 3], border: Border, random: &mut Random) -> Example {
    let input = Planes::from_fn(size, border, |_, _, _| random.range(-1.0, 1.0));
    let class = |_| if random.chance(0.2) { UNKNOWN } else { random.index(CLASSES) as u8 };
    let truth = (0..size[1] * size[2] * FOLD).map(class).collect();
    let [channels, rows, columns] = [size[0], size[1] / 2, size[2]];
    let sparse = Planes::from_fn([channels, rows, columns], border, |_, _, _| random.range(-1.0, 1.0));
    let of_row = columns * FOLD;
    let pixels = (0..rows * of_row).map(|pixel| [pixel, pixel + (pixel / of_row + 1) * of_row]);
    let pixels = pixels.map(|pair| pair.map(|pixel| pixel as u32)).collect();
    Example { sparse_view: Some(SparseView { input: sparse, pixels }), ..Example::new(input, truth) }
}

#[test]
fn derivatives_by_operations_of_candle_are_those_of_kernels() {
    compare_derivatives(&Device::Cpu);
}

#[cfg(feature = "cuda")]
#[test]
fn derivatives_on_a_gpu_are_those_of_kernels() {
    compare_derivatives(&Device::new_cuda(0).expect("a GPU"));
}

/// The loss covers a part of the pixels, and the images have two sizes.
fn compare_derivatives(device: &Device) {
    let specs = [
        NetworkSpec::Unet { inputs: 7, outputs: CLASSES * FOLD, widths: vec![16, 20, 35], head: Some(24) },
        NetworkSpec::Unet { inputs: 20, outputs: CLASSES * FOLD, widths: vec![17], head: None },
    ];
    let loss = Loss::WeightedCrossEntropyPowerJaccard { weights: vec![1.0, 2.0, 0.5], power: 2.0 };
    let criterion =
        || Criterion::new(loss.clone(), Some(Hierarchy::new(vec![0, 1, 1])), CLASSES, 150).with_terms(0.7, 0.0);
    let mut random = Random::new(3);
    for (spec, border) in specs.iter().flat_map(|spec| [Border::Circular, Border::Zero].map(|border| (spec, border))) {
        let sizes = [[8, 16], [16, 24], [8, 16]];
        let batch: Vec<Example> = sizes
            .map(|[height, width]| example([spec.inputs(), height, width], border, &mut random))
            .into_iter()
            .collect();
        let network = || ImageNetwork::new(Variables::random(spec, 5).expect("variables"), FOLD, border);
        let derive = |mut network: ImageNetwork| {
            network.derive(&batch, &criterion(), Random::new(8)).expect("derives").expect("pixels have classes")
        };
        let expected = derive(network());
        let got = derive(network().on_device(device.clone()));
        assert!((got.loss - expected.loss).abs() < 1e-5 * expected.loss, "{} for {}", got.loss, expected.loss);
        assert_eq!(got.gradients.len(), expected.gradients.len());
        for (name, expected) in &expected.gradients {
            let norm = expected.iter().map(|value| value * value).sum::<f32>().sqrt();
            assert!(norm > 1e-4, "{name} of {spec:?}: derivative of norm {norm}");
            for (got, expected) in got.gradients[name].iter().zip(expected) {
                assert!((got - expected).abs() < 1e-4 * norm, "{name} of {spec:?}, {border:?}: {got} for {expected}");
            }
        }
    }
}
