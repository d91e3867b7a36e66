//! Spherical `DZNet` after thesis figure 6.10. The thesis does not state its widths; they are settings here.

use crate::SegmentationError;
use crate::network::executor::Executor;
use crate::network::layer::{CLASS_LAYER, Layer};
use kernels::images::Shape;

/// Dropout rate after 1 x 1 convolutions, in training.
const DROPOUT: f32 = 0.1;

pub(in crate::network) fn layers(inputs: usize, outputs: usize, widths: &[usize]) -> Vec<Layer> {
    let mut layers = Vec::new();
    let mut channels = inputs;
    for (level, &width) in widths.iter().enumerate() {
        let shape =
            Shape { kernel: [5, 5], stride_x: 2, in_channels: vec![channels], out_channels: width, rectify: true };
        layers.push(Layer { name: format!("down.{level}.0"), shape });
        layers.push(Layer::square(format!("down.{level}.1"), 1, vec![width], width, true));
        channels = width;
    }
    for level in (0..widths.len() - 1).rev() {
        layers.push(Layer::square(format!("up.{level}"), 1, vec![widths[level], channels], widths[level], true));
        channels = widths[level];
    }
    layers.push(Layer::square(CLASS_LAYER.to_owned(), 1, vec![inputs, channels], outputs, false));
    layers
}

pub(in crate::network) fn run<E: Executor>(
    executor: &mut E,
    layers: &[Layer],
    levels: usize,
    input: &E::Image,
) -> Result<E::Image, SegmentationError> {
    let mut layers = layers.iter();
    let mut next = || layers.next().expect("layers() lists every layer");
    let mut images: Vec<E::Image> = Vec::new();
    for _ in 0..levels {
        let halved = executor.convolution(next(), &[images.last().unwrap_or(input)])?;
        let mixed = executor.convolution(next(), &[&halved])?;
        images.push(executor.dropout(mixed, DROPOUT)?);
    }
    let mut image = images.pop().expect("at least one level");
    while let Some(finer) = images.pop() {
        let large = executor.upsample(&image, [1, 2])?;
        let mixed = executor.convolution(next(), &[&finer, &large])?;
        image = executor.dropout(mixed, DROPOUT)?;
    }
    let large = executor.upsample(&image, [1, 2])?;
    executor.convolution(next(), &[input, &large])
}
