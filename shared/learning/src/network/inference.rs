//! A network on the engine.

use super::{Executor, Layer, NetworkSpec, Weights};
use crate::LearningError;
use crate::engine::{Border, Filter, Planes, Shape, convolve, max_pool, upsample};
use std::ops::Deref;
use std::sync::{Mutex, PoisonError};

/// A network ready to run, on any number of threads at a time.
#[derive(Debug)]
pub struct Inference {
    spec: NetworkSpec,
    filters: Vec<Filter>,
    border: Border,
    spare: Spare,
    spare_inputs: Spare,
}

/// Images of earlier runs, to be written again: to clear new memory takes a tenth of a run.
#[derive(Debug, Default)]
pub struct Spare(Mutex<Vec<Planes>>);

/// An image: the input, or one that goes back to the spare ones when nobody needs it any more.
pub enum Lent<'a> {
    /// The input.
    Input(&'a Planes),
    /// Made by a layer.
    Made(Planes, &'a Spare),
}

impl<'a> Lent<'a> {
    /// One of this size: zeros above and below, anything elsewhere.
    fn new(spare: &'a Spare, channels: usize, height: usize, width: usize) -> Self {
        let mut images = spare.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_fit = |image: &Planes| (image.channels(), image.height(), image.width()) == (channels, height, width);
        let found = images.iter().position(is_fit).map(|index| images.swap_remove(index));
        Self::Made(found.unwrap_or_else(|| Planes::zeros(channels, height, width)), spare)
    }
    /// Has `f` write all but the border, and fills that.
    fn written(mut self, border: Border, f: impl FnOnce(&mut Planes)) -> Self {
        if let Self::Made(image, _) = &mut self {
            f(image);
            image.fill_border(border);
        }
        self
    }
}

impl Deref for Lent<'_> {
    type Target = Planes;
    fn deref(&self) -> &Planes {
        match self {
            Self::Input(image) => image,
            Self::Made(image, _) => image,
        }
    }
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        if let Self::Made(image, spare) = self {
            let image = std::mem::replace(image, Planes::zeros(0, 0, 0));
            spare.0.lock().unwrap_or_else(PoisonError::into_inner).push(image);
        }
    }
}

/// One run through the layers.
struct Run<'a> {
    filters: std::slice::Iter<'a, Filter>,
    border: Border,
    spare: &'a Spare,
}

impl Inference {
    /// From weights.
    ///
    /// # Errors
    /// If a tensor is absent or of another shape.
    pub fn new(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, LearningError> {
        let filters = weights.filters(&spec)?;
        Ok(Self { spec, filters, border, spare: Spare::default(), spare_inputs: Spare::default() })
    }
    /// The same network but for its last layer, that passes on what it reads: the features that classes are told from, of all its
    /// sources one behind the other.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_features(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, LearningError> {
        let mut network = Self::new(spec, weights, border)?;
        let last = network.filters.last_mut().expect("a network has layers");
        let n: usize = last.shape.in_channels.iter().sum();
        let shape = Shape { out_channels: n, kernel: [1, 1], rectify: false, ..last.shape.clone() };
        let identity: Vec<f32> = (0..n * n).map(|i| f32::from(u8::from(i / n == i % n))).collect();
        *last = Filter::new(shape, &identity, &vec![0.0; n]);
        Ok(network)
    }
    /// The network's form.
    pub fn spec(&self) -> &NetworkSpec {
        &self.spec
    }
    /// An image for [`Self::run`], all but its border written by `write`.
    pub fn input(&self, height: usize, width: usize, write: impl FnOnce(&mut Planes)) -> Lent<'_> {
        Lent::new(&self.spare_inputs, self.spec.channels().0, height, width).written(self.border, write)
    }
    /// Applies the network to an image, border filled.
    ///
    /// # Errors
    /// If the image has not the channels and multiples that the network needs.
    pub fn run<'a>(&'a self, input: &'a Planes) -> Result<Lent<'a>, LearningError> {
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
        let mut run = Run { filters: self.filters.iter(), border: self.border, spare: &self.spare };
        self.spec.run(&mut run, Lent::Input(input))
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

impl<'a> Executor for Run<'a> {
    type Image = Lent<'a>;

    fn convolution(&mut self, _: &Layer, sources: &[&Lent<'a>]) -> Result<Lent<'a>, LearningError> {
        let filter = self.filters.next().expect("one filter for each layer");
        let sources: Vec<&Planes> = sources.iter().map(|source| &***source).collect();
        let (height, width) = (sources[0].height(), filter.shape.out_width(sources[0].width()));
        let out = Lent::new(self.spare, filter.shape.out_channels, height, width);
        Ok(out.written(self.border, |out| convolve(filter, &sources, out)))
    }
    fn max_pool(&mut self, image: &Lent<'a>, factor: [usize; 2]) -> Result<Lent<'a>, LearningError> {
        let out = Lent::new(self.spare, image.channels(), image.height() / factor[0], image.width() / factor[1]);
        Ok(out.written(self.border, |out| max_pool(image, factor, out)))
    }
    fn upsample(&mut self, image: &Lent<'a>, factor: [usize; 2]) -> Result<Lent<'a>, LearningError> {
        let out = Lent::new(self.spare, image.channels(), image.height() * factor[0], image.width() * factor[1]);
        Ok(out.written(self.border, |out| upsample(image, factor, out)))
    }
    fn dropout(&mut self, image: Lent<'a>, _: f32) -> Result<Lent<'a>, LearningError> {
        Ok(image)
    }
}
