//! Convolution of one or two images with a packed filter.

use super::tensors::{features, image_dims, numbers, planes, storage, with_numbers};
use crate::engine::{Border, Feature, Filter, LANES, Planes, Shape, convolve, input_gradient, weight_gradient};
use candle_core::{CpuStorage, CustomOp2, CustomOp3, Layout, Result, Tensor, bail};
use rayon::prelude::*;

/// The convolution of the sources, as if their channels stood one after the other, with bias and, if the shape says so,
/// rectifier. `packed` comes from [`super::pack()`].
///
/// # Errors
/// If there are not one or two sources of one size, or they do not fit the shape.
pub fn convolution(sources: &[&Tensor], packed: &Tensor, shape: &Shape, border: Border) -> Result<Tensor> {
    let operation = Convolution { shape: shape.clone(), border };
    match sources {
        [one] => one.contiguous()?.apply_op2(packed, operation),
        [one, two] => one.contiguous()?.apply_op3(&two.contiguous()?, packed, operation),
        _ => bail!("a convolution has one or two sources, got {}", sources.len()),
    }
}

struct Convolution {
    shape: Shape,
    border: Border,
}

/// Pixels of a batch of images, and batch, blocks, rows and columns.
type Source<'a> = (&'a [Feature], [usize; 4]);

impl Convolution {
    fn filter(&self, packed: &[f32]) -> Result<Filter> {
        let expected = self.shape.packed_rows() * LANES;
        if packed.len() != expected {
            bail!("a filter of {} numbers, expected {expected}", packed.len());
        }
        Ok(Filter::from_packed(self.shape.clone(), features(packed).to_vec()))
    }
    fn images(&self, sources: &[Source<'_>], index: usize) -> Vec<Planes> {
        let with_channels = sources.iter().zip(&self.shape.in_channels);
        with_channels.map(|((pixels, dims), &n)| planes(pixels, *dims, n, index, self.border)).collect()
    }
    fn forward(&self, sources: &[Source<'_>], packed: &[f32]) -> Result<(CpuStorage, candle_core::Shape)> {
        let filter = self.filter(packed)?;
        let [n, _, height, width] = self.check(sources)?;
        let out_width = self.shape.out_width(width);
        let of_image = |index| {
            let images = self.images(sources, index);
            let mut out = Planes::zeros(self.shape.out_channels, height, out_width);
            convolve(&filter, &images.iter().collect::<Vec<_>>(), &mut out);
            out.to_inner()
        };
        let pixels: Vec<Vec<Feature>> = (0..n).into_par_iter().map(of_image).collect();
        let dims = [n, self.shape.out_channels.div_ceil(LANES), height, out_width, LANES];
        Ok((storage(pixels.concat()), candle_core::Shape::from(&dims)))
    }
    fn check(&self, sources: &[Source<'_>]) -> Result<[usize; 4]> {
        let [n, _, height, width] = sources[0].1;
        for ((_, dims), channels) in sources.iter().zip(&self.shape.in_channels) {
            let expected = [n, channels.div_ceil(LANES), height, width];
            if *dims != expected {
                bail!("an image of batch, blocks, rows, columns {dims:?}, expected {expected:?}");
            }
        }
        if sources.len() != self.shape.in_channels.len() || !width.is_multiple_of(self.shape.stride_x) {
            bail!("{} sources of {width} columns do not fit {:?}", sources.len(), self.shape);
        }
        Ok(sources[0].1)
    }
    /// Derivatives by the sources and by the packed filter.
    fn backward(
        &self,
        sources: &[&Tensor],
        packed: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Vec<Tensor>, Tensor)> {
        let filter = with_numbers(packed, |packed| self.filter(packed))?;
        let dims: Vec<[usize; 4]> = sources.iter().map(|source| image_dims(source.shape())).collect::<Result<_>>()?;
        let out_dims = image_dims(result.shape())?;
        let per_image = with_numbers(gradient, |gradient| {
            with_numbers(result, |result| {
                with_all_numbers(sources, &mut Vec::new(), &mut |pixels| {
                    let sources: Vec<Source<'_>> = pixels.iter().copied().zip(dims.iter().copied()).collect();
                    let of_image = |index| {
                        let images = self.images(&sources, index);
                        let gradient = self.before_rectifier(features(gradient), features(result), out_dims, index);
                        let by_weights = weight_gradient(&self.shape, &images.iter().collect::<Vec<_>>(), &gradient);
                        let by_sources = input_gradient(&filter, &gradient, self.border);
                        (by_weights, by_sources.iter().map(Planes::to_inner).collect::<Vec<_>>())
                    };
                    Ok((0..dims[0][0]).into_par_iter().map(of_image).collect::<Vec<_>>())
                })
            })
        })?;
        let mut by_weights = vec![[0.0; LANES]; self.shape.packed_rows()];
        let mut by_sources: Vec<Vec<Feature>> = vec![Vec::new(); sources.len()];
        for (weights, pixels) in per_image {
            for (sum, row) in by_weights.iter_mut().zip(weights) {
                sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
            }
            by_sources.iter_mut().zip(pixels).for_each(|(all, pixels)| all.extend(pixels));
        }
        let as_tensor = |pixels: Vec<Feature>, like: &Tensor| {
            Tensor::from_vec(pixels.into_flattened(), like.shape(), like.device())
        };
        let by_sources = by_sources.into_iter().zip(sources).map(|(pixels, like)| as_tensor(pixels, like));
        Ok((by_sources.collect::<Result<_>>()?, as_tensor(by_weights, packed)?))
    }
    /// The derivative by what the rectifier saw: none where it gave zero.
    fn before_rectifier(&self, gradient: &[Feature], result: &[Feature], dims: [usize; 4], index: usize) -> Planes {
        let mut planes = planes(gradient, dims, self.shape.out_channels, index, Border::Zero);
        if self.shape.rectify {
            let [_, blocks, height, width] = dims;
            let results = result[index * blocks * height * width..].chunks_exact(width);
            for (i, results) in results.take(blocks * height).enumerate() {
                for (pixel, result) in planes.row_mut(i / height, i % height).iter_mut().zip(results) {
                    for lane in 0..LANES {
                        pixel[lane] = if result[lane] > 0.0 { pixel[lane] } else { 0.0 };
                    }
                }
            }
        }
        planes
    }
}

/// Runs `f` on the pixels of all tensors.
fn with_all_numbers<R>(
    tensors: &[&Tensor],
    pixels: &mut Vec<&[Feature]>,
    f: &mut dyn FnMut(&[&[Feature]]) -> Result<R>,
) -> Result<R> {
    let Some((first, rest)) = tensors.split_first() else { return f(pixels) };
    with_numbers(first, |numbers| {
        let mut pixels: Vec<&[Feature]> = pixels.clone();
        pixels.push(features(numbers));
        with_all_numbers(rest, &mut pixels, f)
    })
}

impl CustomOp2 for Convolution {
    fn name(&self) -> &'static str {
        "convolution"
    }
    fn cpu_fwd(
        &self,
        image: &CpuStorage,
        image_layout: &Layout,
        packed: &CpuStorage,
        packed_layout: &Layout,
    ) -> Result<(CpuStorage, candle_core::Shape)> {
        let source = (features(numbers(image, image_layout)?), image_dims(image_layout.shape())?);
        self.forward(&[source], numbers(packed, packed_layout)?)
    }
    fn bwd(
        &self,
        image: &Tensor,
        packed: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (mut by_sources, by_packed) = self.backward(&[image], packed, result, gradient)?;
        Ok((by_sources.pop(), Some(by_packed)))
    }
}

impl CustomOp3 for Convolution {
    fn name(&self) -> &'static str {
        "convolution of two images"
    }
    fn cpu_fwd(
        &self,
        one: &CpuStorage,
        one_layout: &Layout,
        two: &CpuStorage,
        two_layout: &Layout,
        packed: &CpuStorage,
        packed_layout: &Layout,
    ) -> Result<(CpuStorage, candle_core::Shape)> {
        let one = (features(numbers(one, one_layout)?), image_dims(one_layout.shape())?);
        let two = (features(numbers(two, two_layout)?), image_dims(two_layout.shape())?);
        self.forward(&[one, two], numbers(packed, packed_layout)?)
    }
    fn bwd(
        &self,
        one: &Tensor,
        two: &Tensor,
        packed: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let (mut by_sources, by_packed) = self.backward(&[one, two], packed, result, gradient)?;
        let by_two = by_sources.pop();
        Ok((by_sources.pop(), by_two, Some(by_packed)))
    }
}
