//! A reference of the networks in f64: variables, standardization of filters, and all layers, written from their
//! definitions.

use kernels::images::Border;
use segmentation::SegmentationError;
use segmentation::network::{Executor, Layer, NetworkSpec};
use std::collections::BTreeMap;
use training::Variables;

/// Values of all variables by name.
pub type Values = BTreeMap<String, Vec<f64>>;

/// Added to the variance of the weights of a filter.
const MIN_VARIANCE: f64 = 1e-8;

/// An image by channel, row and column.
#[derive(Clone)]
pub struct Image {
    pub channels: usize,
    pub height: usize,
    pub width: usize,
    pub values: Vec<f64>,
}

impl Image {
    pub fn zeros(channels: usize, height: usize, width: usize) -> Self {
        Self { channels, height, width, values: vec![0.0; channels * height * width] }
    }
    pub fn index(&self, channel: usize, y: usize, x: usize) -> usize {
        (channel * self.height + y) * self.width + x
    }
    /// Value of a pixel, with circular columns or zeros left and right of the image, and zeros above and below.
    fn padded(&self, channel: usize, y: isize, x: isize, border: Border) -> f64 {
        let is_beside = !(0..self.width as isize).contains(&x);
        if !(0..self.height as isize).contains(&y) || (border == Border::Zero && is_beside) {
            return 0.0;
        }
        self.values[self.index(channel, y as usize, x.rem_euclid(self.width as isize) as usize)]
    }
    fn from_fn(size: [usize; 3], value: impl Fn(usize, usize, usize) -> f64) -> Self {
        let mut image = Self::zeros(size[0], size[1], size[2]);
        for channel in 0..size[0] {
            for y in 0..size[1] {
                for x in 0..size[2] {
                    let at = image.index(channel, y, x);
                    image.values[at] = value(channel, y, x);
                }
            }
        }
        image
    }
}

/// The values of variables in f64.
pub fn values_of(variables: &Variables) -> Values {
    variables.iter().map(|(name, var)| (name.to_owned(), numbers(var))).collect()
}

/// The values of a variable in f64.
pub fn numbers(var: &candle_core::Var) -> Vec<f64> {
    let values = var.flatten_all().and_then(|values| values.to_vec1::<f32>()).expect("f32");
    values.into_iter().map(f64::from).collect()
}

/// The output of a network.
pub fn run(spec: &NetworkSpec, values: &Values, input: Image) -> Image {
    run_to_features(spec, values, input, Border::Circular)[1].clone()
}

/// The features that the last layer maps to the output, and the output.
pub fn run_to_features(spec: &NetworkSpec, values: &Values, input: Image, border: Border) -> [Image; 2] {
    let mut reference = Reference { values, border, features: None };
    let output = spec.run(&mut reference, input).expect("runs");
    [reference.features.expect("a last layer"), output]
}

struct Reference<'a> {
    values: &'a Values,
    border: Border,
    /// First source of the last convolution so far.
    features: Option<Image>,
}

impl Reference<'_> {
    /// Filters `[out][in, row, column]` with mean 0 and norm `gain`.
    fn filters(&self, layer: &Layer) -> Vec<Vec<f64>> {
        let [raw, gains] = ["raw", "gain"].map(|kind| &self.values[&format!("{}.{kind}", layer.name)]);
        let fan_in = raw.len() / layer.shape.out_channels;
        let standardized = |(filter, gain): (&[f64], &f64)| {
            let n = fan_in as f64;
            let mean = if fan_in > 1 { filter.iter().sum::<f64>() / n } else { 0.0 };
            let variance = filter.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
            let scale = gain / ((variance + MIN_VARIANCE) * n).sqrt();
            filter.iter().map(|v| (v - mean) * scale).collect()
        };
        raw.chunks_exact(fan_in).zip(gains).map(standardized).collect()
    }
}

impl Executor for Reference<'_> {
    type Image = Image;

    fn convolution(&mut self, layer: &Layer, sources: &[&Image]) -> Result<Image, SegmentationError> {
        let shape = &layer.shape;
        let filters = self.filters(layer);
        let biases = &self.values[&format!("{}.bias", layer.name)];
        let [rows, columns] = shape.kernel;
        self.features = Some(sources[0].clone());
        let size = [shape.out_channels, sources[0].height, shape.out_width(sources[0].width)];
        Ok(Image::from_fn(size, |out, y, x| {
            let mut sum = biases[out];
            let mut weights = filters[out].iter();
            for source in sources {
                for channel in 0..source.channels {
                    for row in 0..rows {
                        for column in 0..columns {
                            let y = (y + row) as isize - (rows / 2) as isize;
                            let x = (x * shape.stride_x + column) as isize - (columns / 2) as isize;
                            sum +=
                                weights.next().expect("one for each tap") * source.padded(channel, y, x, self.border);
                        }
                    }
                }
            }
            if shape.rectify { sum.max(0.0) } else { sum }
        }))
    }
    fn max_pool(&mut self, image: &Image, [rows, columns]: [usize; 2]) -> Result<Image, SegmentationError> {
        let size = [image.channels, image.height / rows, image.width / columns];
        Ok(Image::from_fn(size, |channel, y, x| {
            let window = (0..rows * columns).map(|i| (y * rows + i / columns, x * columns + i % columns));
            window.fold(f64::NEG_INFINITY, |largest, (y, x)| largest.max(image.values[image.index(channel, y, x)]))
        }))
    }
    fn upsample(&mut self, image: &Image, [rows, columns]: [usize; 2]) -> Result<Image, SegmentationError> {
        let size = [image.channels, image.height * rows, image.width * columns];
        Ok(Image::from_fn(size, |channel, y, x| image.values[image.index(channel, y / rows, x / columns)]))
    }
    fn dropout(&mut self, image: Image, _: f32) -> Result<Image, SegmentationError> {
        Ok(image)
    }
}
