//! A network on the engine that remembers its way, for derivatives.

use super::{Executor, Layer, NetworkSpec, Weights};
use crate::engine::{
    Border, Feature, Filter, Planes, convolve, input_gradient, max_pool, max_pool_gradient, upsample,
    upsample_gradient, weight_gradient,
};
use crate::{LearningError, Random};

/// A network with its filters turned around, too.
pub struct Differential {
    spec: NetworkSpec,
    filters: Vec<Filter>,
    /// By layer and source.
    turned: Vec<Vec<Filter>>,
    border: Border,
}

/// What one image left on its way. Image 0 is the input, image n + 1 what step n made.
pub struct Recording {
    images: Vec<Planes>,
    steps: Vec<Step>,
}

enum Step {
    Convolution { layer: usize, sources: Vec<usize> },
    MaxPool { source: usize, factor: [usize; 2] },
    Upsample { source: usize, factor: [usize; 2] },
    Dropout { source: usize, factors: Planes },
}

impl Recording {
    /// The network's result.
    pub fn result(&self) -> &Planes {
        self.images.last().expect("there is an input")
    }
}

impl Differential {
    /// From weights.
    ///
    /// # Errors
    /// If a tensor is absent or of another shape.
    pub fn new(spec: &NetworkSpec, weights: &Weights, border: Border) -> Result<Self, LearningError> {
        let filters = weights.filters(spec)?;
        let turned = filters.iter().map(Filter::turned).collect();
        Ok(Self { spec: spec.clone(), filters, turned, border })
    }
    /// Applies the network to an image, border filled; with dropout if there are random numbers for it.
    ///
    /// # Errors
    /// If the network cannot run.
    pub fn run(&self, input: Planes, dropout: Option<Random>) -> Result<Recording, LearningError> {
        let recording = Recording { images: vec![input], steps: Vec::new() };
        let mut run = Run { network: self, recording, n_layers: 0, dropout };
        self.spec.run(&mut run, 0)?;
        Ok(run.recording)
    }
    /// Derivatives by the packed filters, by layer, from that by the result.
    pub fn derive(&self, recording: &Recording, by_result: Planes) -> Vec<Vec<Feature>> {
        let Recording { images, steps } = recording;
        let mut by_filters = vec![Vec::new(); self.filters.len()];
        let mut by_images: Vec<Option<Planes>> = vec![None; images.len()];
        *by_images.last_mut().expect("there is an input") = Some(by_result);
        for (n, step) in steps.iter().enumerate().rev() {
            let Some(mut gradient) = by_images[n + 1].take() else { continue };
            let mut add = |source: usize, by: Planes| match &mut by_images[source] {
                Some(sum) => sum.add(&by),
                none => *none = Some(by),
            };
            match step {
                Step::Convolution { layer, sources } => {
                    let filter = &self.filters[*layer];
                    if filter.shape.rectify {
                        gradient.clear_where_zero(&images[n + 1]);
                    }
                    let of_sources: Vec<&Planes> = sources.iter().map(|&source| &images[source]).collect();
                    by_filters[*layer] = weight_gradient(&filter.shape, &of_sources, &gradient);
                    gradient.fill_border(self.border);
                    // Nothing learns from the derivative by the input.
                    for (&source, turned) in sources.iter().zip(&self.turned[*layer]).filter(|(source, _)| **source > 0)
                    {
                        add(source, input_gradient(turned, filter.shape.stride_x, &gradient, self.border));
                    }
                }
                Step::MaxPool { source, factor } => {
                    add(*source, max_pool_gradient(&images[*source], &images[n + 1], &gradient, *factor));
                }
                Step::Upsample { source, factor } => add(*source, upsample_gradient(&gradient, *factor)),
                Step::Dropout { source, factors } => {
                    gradient.scale(factors);
                    add(*source, gradient);
                }
            }
        }
        by_filters
    }
}

/// On its way.
struct Run<'a> {
    network: &'a Differential,
    recording: Recording,
    /// Layers that have been applied.
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

    fn convolution(&mut self, _: &Layer, sources: &[&usize]) -> Result<usize, LearningError> {
        let layer = self.n_layers;
        self.n_layers += 1;
        let filter = &self.network.filters[layer];
        let images: Vec<&Planes> = sources.iter().map(|source| &self.recording.images[**source]).collect();
        let (height, width) = (images[0].height(), filter.shape.out_width(images[0].width()));
        let mut out = Planes::zeros(filter.shape.out_channels, height, width);
        convolve(filter, &images, &mut out);
        let sources = sources.iter().map(|source| **source).collect();
        Ok(self.push(out, Step::Convolution { layer, sources }))
    }
    fn max_pool(&mut self, image: &usize, factor: [usize; 2]) -> Result<usize, LearningError> {
        let image_of = &self.recording.images[*image];
        let (height, width) = (image_of.height() / factor[0], image_of.width() / factor[1]);
        let mut out = Planes::zeros(image_of.channels(), height, width);
        max_pool(image_of, factor, &mut out);
        Ok(self.push(out, Step::MaxPool { source: *image, factor }))
    }
    fn upsample(&mut self, image: &usize, factor: [usize; 2]) -> Result<usize, LearningError> {
        let image_of = &self.recording.images[*image];
        let (height, width) = (image_of.height() * factor[0], image_of.width() * factor[1]);
        let mut out = Planes::zeros(image_of.channels(), height, width);
        upsample(image_of, factor, &mut out);
        Ok(self.push(out, Step::Upsample { source: *image, factor }))
    }
    fn dropout(&mut self, source: usize, rate: f32) -> Result<usize, LearningError> {
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
        out.scale(&factors);
        Ok(self.push(out, Step::Dropout { source, factors }))
    }
}
