//! A model with weights from `PyTorch`: `data/torch_unet.py` wrote the file with an input and the output of torch.

use candle_core::Device;
use kernels::images::{Border, LANES, Planes};
use safetensors::SafeTensors;
use segmentation::network::Inference;
use segmentation::spherical::{LoadedModel, SphericalModel};
use std::path::PathBuf;

/// Shape and values of a tensor of the file.
fn tensor(file: &SafeTensors<'_>, name: &str) -> ([usize; 3], Vec<f32>) {
    let tensor = file.tensor(name).expect("written by the script");
    let shape = tensor.shape().try_into().expect("channels, rows, columns");
    (shape, tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
}

#[test]
fn network_with_torch_weights_gives_output_of_torch() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/torch_unet.safetensors");
    let LoadedModel { model, weights } = SphericalModel::load(&path).expect("a model file");
    let network = Inference::new(model.settings().network.clone(), &weights, Border::Circular).expect("fits");
    let bytes = std::fs::read(&path).expect("is there");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    let (size @ [_, height, width], values) = tensor(&file, "test.input");
    let mut values = values.into_iter();
    let input = Planes::from_fn(size, Border::Circular, |_, _, _| values.next().expect("one for each pixel"));
    let input = input.to_tensor().expect("an image");

    let (shape, expected) = tensor(&file, "test.output");
    let largest = expected.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
    let compare = |network: &Inference| {
        let got = network.run(&input).expect("runs");
        let got = Planes::from_tensor(&got, network.out_channels()).expect("an image");
        assert_eq!([got.channels(), got.height(), got.width()], shape);
        for (i, expected) in expected.iter().enumerate() {
            let channel = i / (height * width);
            let y = i / width % height;
            let x = i % width;
            let got = got.row(channel / LANES, y)[x][channel % LANES];
            assert!(
                (got - expected).abs() < 1e-5 * largest,
                "channel {channel}, row {y}, column {x}: {got} for {expected}"
            );
        }
    };
    compare(&network);
    compare(&network.on_device(Device::Cpu).expect("fits"));
}
