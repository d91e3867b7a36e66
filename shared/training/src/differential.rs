//! A network that records its run, for derivatives (reverse-mode differentiation).

use crate::derivatives::{input_gradient, max_pool_gradient, transposed_filters, upsample_gradient, weight_gradient};
use kernels::images::{Border, Feature, Filter, PlainFilter, Planes, convolve, max_pool, upsample};
use random::Random;
use segmentation::SegmentationError;
use segmentation::network::{Executor, Layer, NetworkSpec, Weights};

/// A network with its transposed filters.
pub struct Differential {
    spec: NetworkSpec,
    filters: Vec<Filter>,
    /// Transposed filters by layer and source.
    transposed: Vec<Vec<Filter>>,
    border: Border,
}

/// All images and steps of a run. Image 0 is the input, image n + 1 the output of step n.
pub struct Recording {
    images: Vec<Planes>,
    steps: Vec<Step>,
}

/// Derivatives of a run down to its input.
pub struct InputDerivatives {
    /// Derivatives with respect to the packed filters of all layers.
    pub by_filters: Vec<Vec<Feature>>,
    /// Derivative with respect to the input.
    pub by_input: Planes,
}

enum Step {
    Convolution { layer: usize, sources: Vec<usize> },
    MaxPool { source: usize, factor: [usize; 2] },
    Upsample { source: usize, factor: [usize; 2] },
    Dropout { source: usize, factors: Planes },
}

impl Recording {
    /// The output of the network.
    pub fn output(&self) -> &Planes {
        self.images.last().expect("there is an input")
    }
    /// The features that the last layer maps to the output: its first source.
    pub fn features(&self) -> &Planes {
        &self.images[self.features_at()]
    }
    fn features_at(&self) -> usize {
        match self.steps.last() {
            Some(Step::Convolution { sources, .. }) => sources[0],
            _ => 0,
        }
    }
    /// One derivative per image; only the derivative with respect to the output is set.
    fn derivatives(&self, by_output: Planes) -> Vec<Option<Planes>> {
        let mut by_images = vec![None; self.images.len()];
        *by_images.last_mut().expect("there is an input") = Some(by_output);
        by_images
    }
}

impl Differential {
    /// Prepares the filters of the network.
    ///
    /// # Errors
    /// If a tensor is missing or has another shape.
    pub fn new(spec: &NetworkSpec, weights: &Weights, border: Border) -> Result<Self, SegmentationError> {
        let filters = weights.filters(spec)?;
        let transposed = filters.iter().map(transposed_filters).collect();
        Ok(Self { spec: spec.clone(), filters, transposed, border })
    }
    /// Runs the network on an image whose border is filled; with dropout if random numbers are given.
    ///
    /// # Errors
    /// If the network cannot run.
    pub fn run(&self, input: Planes, dropout: Option<Random>) -> Result<Recording, SegmentationError> {
        let recording = Recording { images: vec![input], steps: Vec::new() };
        let mut run = Run { network: self, recording, n_layers: 0, dropout };
        self.spec.run(&mut run, 0)?;
        Ok(run.recording)
    }
    /// Derivatives with respect to the packed filters of all layers, from the derivative with respect to the output.
    pub fn backward(&self, recording: &Recording, by_output: Planes) -> Vec<Vec<Feature>> {
        // The derivative with respect to the input of the network is not needed.
        self.backward_through(recording, &mut recording.derivatives(by_output), 1)
    }
    /// [`Self::backward`] for a loss that also depends directly on [`Recording::features`], with this derivative.
    pub fn backward_with_features(
        &self,
        recording: &Recording,
        by_output: Planes,
        by_features: Planes,
    ) -> Vec<Vec<Feature>> {
        let mut by_images = recording.derivatives(by_output);
        by_images[recording.features_at()] = Some(by_features);
        self.backward_through(recording, &mut by_images, 1)
    }
    /// Like [`Self::backward`], but also returns the derivative with respect to the input.
    pub fn backward_to_input(&self, recording: &Recording, by_output: Planes) -> InputDerivatives {
        let mut by_images = recording.derivatives(by_output);
        let by_filters = self.backward_through(recording, &mut by_images, 0);
        let by_input = by_images.swap_remove(0).expect("the output depends on the input");
        InputDerivatives { by_filters, by_input }
    }
    /// Derivatives with respect to the filters of the layers: sums over several runs.
    pub fn per_layer(&self, by_runs: Vec<Vec<Vec<Feature>>>) -> Vec<PlainFilter> {
        let layers = self.spec.layers();
        layers.iter().zip(sum_of(by_runs)).map(|(layer, packed)| layer.shape.unpacked(&packed)).collect()
    }
    /// Completes `by_images`, the derivatives with respect to the images of a recording, starting at image `first`.
    fn backward_through(
        &self,
        recording: &Recording,
        by_images: &mut [Option<Planes>],
        first: usize,
    ) -> Vec<Vec<Feature>> {
        let Recording { images, steps } = recording;
        let mut by_filters = vec![Vec::new(); self.filters.len()];
        for (n, step) in steps.iter().enumerate().rev() {
            let Some(mut gradient) = by_images[n + 1].take() else { continue };
            let mut add = |source: usize, by: Planes| match &mut by_images[source] {
                Some(sum) => add_to(sum, &by),
                none => *none = Some(by),
            };
            match step {
                Step::Convolution { layer, sources } => {
                    let filter = &self.filters[*layer];
                    if filter.shape.rectify {
                        clear_where_zero(&mut gradient, &images[n + 1]);
                    }
                    let of_sources: Vec<&Planes> = sources.iter().map(|&source| &images[source]).collect();
                    by_filters[*layer] = weight_gradient(&filter.shape, &of_sources, &gradient);
                    gradient.fill_border(self.border);
                    for (&source, transposed) in
                        sources.iter().zip(&self.transposed[*layer]).filter(|(source, _)| **source >= first)
                    {
                        add(source, input_gradient(transposed, filter.shape.stride_x, &gradient, self.border));
                    }
                }
                Step::MaxPool { source, factor } => {
                    add(*source, max_pool_gradient(&images[*source], &images[n + 1], &gradient, *factor));
                }
                Step::Upsample { source, factor } => add(*source, upsample_gradient(&gradient, *factor)),
                Step::Dropout { source, factors } => {
                    scale(&mut gradient, factors);
                    add(*source, gradient);
                }
            }
        }
        by_filters
    }
}

/// A run in progress.
struct Run<'a> {
    network: &'a Differential,
    recording: Recording,
    /// Number of layers applied so far.
    n_layers: usize,
    dropout: Option<Random>,
}

impl Run<'_> {
    fn push(&mut self, mut image: Planes, step: Step) -> usize {
        image.fill_border(self.network.border);
        self.recording.images.push(image);
        self.recording.steps.push(step);
        self.recording.steps.len()
    }
}

impl Executor for Run<'_> {
    type Image = usize;

    fn convolution(&mut self, _: &Layer, sources: &[&usize]) -> Result<usize, SegmentationError> {
        let layer = self.n_layers;
        self.n_layers += 1;
        let filter = &self.network.filters[layer];
        let images: Vec<&Planes> = sources.iter().map(|source| &self.recording.images[**source]).collect();
        let height = images[0].height();
        let width = filter.shape.out_width(images[0].width());
        let mut out = Planes::zeros(filter.shape.out_channels, height, width);
        convolve(filter, &images, &mut out);
        let sources = sources.iter().map(|source| **source).collect();
        Ok(self.push(out, Step::Convolution { layer, sources }))
    }
    fn max_pool(&mut self, image: &usize, factor: [usize; 2]) -> Result<usize, SegmentationError> {
        let image_of = &self.recording.images[*image];
        let height = image_of.height() / factor[0];
        let width = image_of.width() / factor[1];
        let mut out = Planes::zeros(image_of.channels(), height, width);
        max_pool(image_of, factor, &mut out);
        Ok(self.push(out, Step::MaxPool { source: *image, factor }))
    }
    fn upsample(&mut self, image: &usize, factor: [usize; 2]) -> Result<usize, SegmentationError> {
        let image_of = &self.recording.images[*image];
        let height = image_of.height() * factor[0];
        let width = image_of.width() * factor[1];
        let mut out = Planes::zeros(image_of.channels(), height, width);
        upsample(image_of, factor, &mut out);
        Ok(self.push(out, Step::Upsample { source: *image, factor }))
    }
    fn dropout(&mut self, source: usize, rate: f32) -> Result<usize, SegmentationError> {
        let Some(random) = &mut self.dropout else { return Ok(source) };
        let mut out = self.recording.images[source].clone();
        let mut factors = Planes::zeros(out.channels(), out.height(), out.width());
        let kept = 1.0 / (1.0 - rate);
        for block in 0..factors.n_blocks() {
            for y in 0..factors.height() {
                for factor in factors.row_mut(block, y).as_flattened_mut() {
                    *factor = if random.chance(rate) { 0.0 } else { kept };
                }
            }
        }
        scale(&mut out, &factors);
        Ok(self.push(out, Step::Dropout { source, factors }))
    }
}

/// Adds an image of the same size, with borders.
fn add_to(sum: &mut Planes, other: &Planes) {
    debug_assert_eq!(sum.values().len(), other.values().len());
    sum.values_mut().iter_mut().zip(other.values()).for_each(|(value, other)| *value += other);
}

/// Multiplies by an image of the same size, with borders.
fn scale(image: &mut Planes, factors: &Planes) {
    debug_assert_eq!(image.values().len(), factors.values().len());
    image.values_mut().iter_mut().zip(factors.values()).for_each(|(value, factor)| *value *= factor);
}

/// Sets the gradient to zero where the output of a rectifier is zero.
fn clear_where_zero(gradient: &mut Planes, output: &Planes) {
    debug_assert_eq!(gradient.values().len(), output.values().len());
    let values = gradient.values_mut().iter_mut().zip(output.values());
    values.for_each(|(value, output)| *value = if *output > 0.0 { *value } else { 0.0 });
}

/// Sums by layer, row and lane, in the order of the runs.
fn sum_of(by_runs: Vec<Vec<Vec<Feature>>>) -> Vec<Vec<Feature>> {
    let mut runs = by_runs.into_iter();
    let mut sum = runs.next().unwrap_or_default();
    for by_layer in runs {
        for (sum, rows) in sum.iter_mut().zip(by_layer) {
            let values = sum.as_flattened_mut().iter_mut().zip(rows.as_flattened());
            values.for_each(|(sum, value)| *sum += value);
        }
    }
    sum
}
