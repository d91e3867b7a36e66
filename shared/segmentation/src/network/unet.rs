//! U-Net: two 3 x 3 convolutions per level of the encoder, one after each upsampling step, a 1 x 1 convolution at the
//! end.
//!
//! A 1 x 1 convolution reduces the coarser level to the width of the finer one before upsampling, which is equivalent
//! to the reverse order and faster.

use crate::SegmentationError;
use crate::network::executor::Executor;
use crate::network::layer::{CLASS_LAYER, Layer};

pub(super) fn layers(inputs: usize, outputs: usize, widths: &[usize], head: Option<usize>) -> Vec<Layer> {
    let mut layers = Vec::new();
    let mut channels = inputs;
    for (level, &width) in widths.iter().enumerate() {
        layers.push(Layer::square(format!("down.{level}.0"), 3, vec![channels], width, true));
        layers.push(Layer::square(format!("down.{level}.1"), 3, vec![width], width, true));
        channels = width;
    }
    for level in (0..widths.len() - 1).rev() {
        let width = widths[level];
        layers.push(Layer::square(format!("up.{level}.0"), 1, vec![channels], width, true));
        channels = head.filter(|_| level == 0).unwrap_or(width);
        layers.push(Layer::square(format!("up.{level}.1"), 3, vec![width, width], channels, true));
    }
    layers.push(Layer::square(CLASS_LAYER.to_owned(), 1, vec![channels], outputs, false));
    layers
}

pub(super) fn run<E: Executor>(
    executor: &mut E,
    layers: &[Layer],
    levels: usize,
    input: E::Image,
) -> Result<E::Image, SegmentationError> {
    let mut layers = layers.iter();
    let mut next = || layers.next().expect("layers() lists every layer");
    let mut finer: Vec<E::Image> = Vec::new();
    let mut image = input;
    for level in 0..levels {
        if level > 0 {
            let pooled = executor.max_pool(&image, [2, 2])?;
            finer.push(std::mem::replace(&mut image, pooled));
        }
        image = executor.convolution(next(), &[&image])?;
        image = executor.convolution(next(), &[&image])?;
    }
    while let Some(skip) = finer.pop() {
        let narrow = executor.convolution(next(), &[&image])?;
        let large = executor.upsample(&narrow, [2, 2])?;
        image = executor.convolution(next(), &[&skip, &large])?;
    }
    executor.convolution(next(), &[&image])
}
