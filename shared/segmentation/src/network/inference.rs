//! Inference: a network on the convolution engine.

use super::{Executor, Layer, NetworkSpec, Weights};
use crate::SegmentationError;
use crate::engine::{Border, Filter, Planes, Shape, convolve, max_pool, upsample};
use std::ops::Deref;
use std::sync::{Mutex, PoisonError};

/// A network ready to run. Several threads may run it at the same time.
#[derive(Debug)]
pub struct Inference {
    spec: NetworkSpec,
    filters: Vec<Filter>,
    border: Border,
    pool: ImagePool,
    input_pool: ImagePool,
}

/// Images that are reused between runs, because clearing new memory takes a tenth of a run.
#[derive(Debug, Default)]
pub struct ImagePool(Mutex<Vec<Planes>>);

/// An image: the input, or one that returns to its pool when dropped.
pub enum PooledImage<'a> {
    /// The input.
    Input(&'a Planes),
    /// The output of a layer.
    Output(Planes, &'a ImagePool),
}

impl<'a> PooledImage<'a> {
    /// An image of this size: zeros above and below, arbitrary values elsewhere.
    fn new(pool: &'a ImagePool, channels: usize, height: usize, width: usize) -> Self {
        let mut images = pool.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_fit = |image: &Planes| (image.channels(), image.height(), image.width()) == (channels, height, width);
        let found = images.iter().position(is_fit).map(|index| images.swap_remove(index));
        Self::Output(found.unwrap_or_else(|| Planes::zeros(channels, height, width)), pool)
    }
    /// Lets `write` write everything except the border, then fills the border.
    fn written(mut self, border: Border, write: impl FnOnce(&mut Planes)) -> Self {
        if let Self::Output(image, _) = &mut self {
            write(image);
            image.fill_border(border);
        }
        self
    }
}

impl Deref for PooledImage<'_> {
    type Target = Planes;
    fn deref(&self) -> &Planes {
        match self {
            Self::Input(image) => image,
            Self::Output(image, _) => image,
        }
    }
}

impl Drop for PooledImage<'_> {
    fn drop(&mut self) {
        if let Self::Output(image, pool) = self {
            let image = std::mem::replace(image, Planes::zeros(0, 0, 0));
            pool.0.lock().unwrap_or_else(PoisonError::into_inner).push(image);
        }
    }
}

/// One run through the layers.
struct Run<'a> {
    filters: std::slice::Iter<'a, Filter>,
    border: Border,
    pool: &'a ImagePool,
}

impl Inference {
    /// Prepares the filters of the network.
    ///
    /// # Errors
    /// If a tensor is missing or has another shape.
    pub fn new(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, SegmentationError> {
        let filters = weights.filters(&spec)?;
        Ok(Self { spec, filters, border, pool: ImagePool::default(), input_pool: ImagePool::default() })
    }
    /// The network with an identity as last layer: its output are the features of the classifier, all sources concatenated.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_features(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, SegmentationError> {
        let mut network = Self::new(spec, weights, border)?;
        let last = network.filters.last_mut().expect("a network has layers");
        let n: usize = last.shape.in_channels.iter().sum();
        let shape = Shape { out_channels: n, kernel: [1, 1], rectify: false, ..last.shape.clone() };
        let identity: Vec<f32> = (0..n * n).map(|i| f32::from(u8::from(i / n == i % n))).collect();
        *last = Filter::new(shape, &identity, &vec![0.0; n]);
        Ok(network)
    }
    /// Architecture of the network.
    pub fn spec(&self) -> &NetworkSpec {
        &self.spec
    }
    /// An input for [`Self::run`]. `write` writes everything except its border.
    pub fn input(&self, height: usize, width: usize, write: impl FnOnce(&mut Planes)) -> PooledImage<'_> {
        PooledImage::new(&self.input_pool, self.spec.channels().0, height, width).written(self.border, write)
    }
    /// Runs the network on an image whose border is filled.
    ///
    /// # Errors
    /// If channels, rows or columns of the image do not fit the network.
    pub fn run<'a>(&'a self, input: &'a Planes) -> Result<PooledImage<'a>, SegmentationError> {
        let [rows, columns] = self.spec.multiple_of();
        let fits = input.height().is_multiple_of(rows) && input.width().is_multiple_of(columns);
        if !fits || input.channels() != self.spec.channels().0 {
            let found = [input.channels(), input.height(), input.width()];
            let channels = self.spec.channels().0;
            return Err(SegmentationError::InputSize { found, channels, multiple_of: [rows, columns] });
        }
        let mut run = Run { filters: self.filters.iter(), border: self.border, pool: &self.pool };
        self.spec.run(&mut run, PooledImage::Input(input))
    }
    /// Number of multiplications and additions for an image of this size.
    pub fn flops(&self, height: usize, width: usize) -> usize {
        struct Count(usize);
        impl Executor for Count {
            type Image = [usize; 2];
            fn convolution(&mut self, layer: &Layer, sources: &[&[usize; 2]]) -> Result<[usize; 2], SegmentationError> {
                let [height, width] = *sources[0];
                let width = layer.shape.out_width(width);
                let n_in: usize = layer.shape.in_channels.iter().sum();
                let per_pixel = 2 * n_in * layer.shape.out_channels * layer.shape.kernel[0] * layer.shape.kernel[1];
                self.0 += per_pixel * height * width;
                Ok([height, width])
            }
            fn max_pool(&mut self, image: &[usize; 2], factor: [usize; 2]) -> Result<[usize; 2], SegmentationError> {
                Ok([image[0] / factor[0], image[1] / factor[1]])
            }
            fn upsample(&mut self, image: &[usize; 2], factor: [usize; 2]) -> Result<[usize; 2], SegmentationError> {
                Ok([image[0] * factor[0], image[1] * factor[1]])
            }
            fn dropout(&mut self, image: [usize; 2], _: f32) -> Result<[usize; 2], SegmentationError> {
                Ok(image)
            }
        }
        let mut count = Count(0);
        self.spec.run(&mut count, [height, width]).map_or(0, |_| count.0)
    }
}

impl<'a> Executor for Run<'a> {
    type Image = PooledImage<'a>;

    fn convolution(&mut self, _: &Layer, sources: &[&PooledImage<'a>]) -> Result<PooledImage<'a>, SegmentationError> {
        let filter = self.filters.next().expect("one filter for each layer");
        let sources: Vec<&Planes> = sources.iter().map(|source| &***source).collect();
        let (height, width) = (sources[0].height(), filter.shape.out_width(sources[0].width()));
        let out = PooledImage::new(self.pool, filter.shape.out_channels, height, width);
        Ok(out.written(self.border, |out| convolve(filter, &sources, out)))
    }
    fn max_pool(&mut self, image: &PooledImage<'a>, factor: [usize; 2]) -> Result<PooledImage<'a>, SegmentationError> {
        let out = PooledImage::new(self.pool, image.channels(), image.height() / factor[0], image.width() / factor[1]);
        Ok(out.written(self.border, |out| max_pool(image, factor, out)))
    }
    fn upsample(&mut self, image: &PooledImage<'a>, factor: [usize; 2]) -> Result<PooledImage<'a>, SegmentationError> {
        let out = PooledImage::new(self.pool, image.channels(), image.height() * factor[0], image.width() * factor[1]);
        Ok(out.written(self.border, |out| upsample(image, factor, out)))
    }
    fn dropout(&mut self, image: PooledImage<'a>, _: f32) -> Result<PooledImage<'a>, SegmentationError> {
        Ok(image)
    }
}
