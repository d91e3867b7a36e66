//! A network on the engine.

use super::{Executor, Layer, NetworkSpec, Weights};
use crate::LearningError;
use crate::engine::{Border, Filter, Planes, convolve, max_pool, upsample};

/// A network ready to run on one thread.
#[derive(Clone, Debug)]
pub struct Inference {
    spec: NetworkSpec,
    filters: Vec<Filter>,
    border: Border,
}

/// One run through the layers.
struct Run<'a> {
    filters: std::slice::Iter<'a, Filter>,
    border: Border,
}

impl Inference {
    /// From weights.
    ///
    /// # Errors
    /// If a tensor is absent or of another shape.
    pub fn new(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, LearningError> {
        let filters = weights.filters(&spec)?;
        Ok(Self { spec, filters, border })
    }
    /// The network's form.
    pub fn spec(&self) -> &NetworkSpec {
        &self.spec
    }
    /// Applies the network to an image, border filled.
    ///
    /// # Errors
    /// If the image has not the channels and multiples that the network needs.
    pub fn run(&self, input: Planes) -> Result<Planes, LearningError> {
        let [rows, columns] = self.spec.multiple_of();
        let fits = input.height().is_multiple_of(rows) && input.width().is_multiple_of(columns);
        if !fits || input.channels() != self.spec.channels().0 {
            let got = (input.channels(), input.height(), input.width());
            let expected = self.spec.channels().0;
            let reason = format!(
                "an image of channels, rows and columns {got:?}; needed are {expected} channels and multiples of {rows} x {columns}"
            );
            return Err(LearningError::Compute(candle_core::Error::Msg(reason)));
        }
        let mut run = Run { filters: self.filters.iter(), border: self.border };
        self.spec.run(&mut run, input)
    }
    /// Multiplications and additions for an image of this size.
    pub fn flops(&self, height: usize, width: usize) -> usize {
        struct Count(usize);
        impl Executor for Count {
            type Image = [usize; 2];
            fn convolution(&mut self, layer: &Layer, sources: &[&[usize; 2]]) -> Result<[usize; 2], LearningError> {
                let [height, width] = *sources[0];
                let width = layer.shape.out_width(width);
                let n_in: usize = layer.shape.in_channels.iter().sum();
                let per_pixel = 2 * n_in * layer.shape.out_channels * layer.shape.kernel[0] * layer.shape.kernel[1];
                self.0 += per_pixel * height * width;
                Ok([height, width])
            }
            fn max_pool(&mut self, image: &[usize; 2], factor: [usize; 2]) -> Result<[usize; 2], LearningError> {
                Ok([image[0] / factor[0], image[1] / factor[1]])
            }
            fn upsample(&mut self, image: &[usize; 2], factor: [usize; 2]) -> Result<[usize; 2], LearningError> {
                Ok([image[0] * factor[0], image[1] * factor[1]])
            }
            fn dropout(&mut self, image: [usize; 2], _: f32) -> Result<[usize; 2], LearningError> {
                Ok(image)
            }
        }
        let mut count = Count(0);
        self.spec.run(&mut count, [height, width]).map_or(0, |_| count.0)
    }
}

impl Executor for Run<'_> {
    type Image = Planes;

    fn convolution(&mut self, _: &Layer, sources: &[&Planes]) -> Result<Planes, LearningError> {
        let filter = self.filters.next().expect("one filter for each layer");
        let (height, width) = (sources[0].height(), filter.shape.out_width(sources[0].width()));
        let mut out = Planes::zeros(filter.shape.out_channels, height, width);
        convolve(filter, sources, &mut out);
        out.fill_border(self.border);
        Ok(out)
    }
    fn max_pool(&mut self, image: &Planes, factor: [usize; 2]) -> Result<Planes, LearningError> {
        let mut out = max_pool(image, factor);
        out.fill_border(self.border);
        Ok(out)
    }
    fn upsample(&mut self, image: &Planes, factor: [usize; 2]) -> Result<Planes, LearningError> {
        let mut out = upsample(image, factor);
        out.fill_border(self.border);
        Ok(out)
    }
    fn dropout(&mut self, image: Planes, _: f32) -> Result<Planes, LearningError> {
        Ok(image)
    }
}
