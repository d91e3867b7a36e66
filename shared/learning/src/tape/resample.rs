//! Pools and upsampling.

use super::tensors::{features, image_dims, numbers, planes, storage, with_numbers};
use crate::engine::{self, Border, Feature, LANES};
use candle_core::{CpuStorage, CustomOp1, Layout, Result, Tensor, bail};
use rayon::prelude::*;

/// The largest of every `factor` rows x columns; its derivative goes to the first of the largest.
///
/// # Errors
/// If it is no image tensor, or the factors do not divide it.
pub fn max_pool(image: &Tensor, factor: [usize; 2]) -> Result<Tensor> {
    image.contiguous()?.apply_op1(MaxPool(factor))
}

/// Every pixel repeated over `factor` rows x columns.
///
/// # Errors
/// If it is no image tensor.
pub fn upsample(image: &Tensor, factor: [usize; 2]) -> Result<Tensor> {
    image.contiguous()?.apply_op1(Upsample(factor))
}

/// Runs `f` on each image of a batch, in parallel.
fn each_image(
    pixels: &CpuStorage,
    layout: &Layout,
    f: impl Fn(&engine::Planes) -> engine::Planes + Sync,
) -> Result<(CpuStorage, candle_core::Shape)> {
    let dims = image_dims(layout.shape())?;
    let pixels = features(numbers(pixels, layout)?);
    let of_image = |index| f(&planes(pixels, dims, dims[1] * LANES, index, Border::Zero));
    let made: Vec<engine::Planes> = (0..dims[0]).into_par_iter().map(of_image).collect();
    let Some(first) = made.first() else { bail!("a batch of no images") };
    let out_dims = [dims[0], dims[1], first.height(), first.width(), LANES];
    let all: Vec<Feature> = made.iter().flat_map(engine::Planes::to_inner).collect();
    Ok((storage(all), candle_core::Shape::from(&out_dims)))
}

struct MaxPool([usize; 2]);

impl CustomOp1 for MaxPool {
    fn name(&self) -> &'static str {
        "max pool"
    }
    fn cpu_fwd(&self, image: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, candle_core::Shape)> {
        let [_, _, height, width] = image_dims(layout.shape())?;
        if !height.is_multiple_of(self.0[0]) || !width.is_multiple_of(self.0[1]) {
            bail!("a pool of {:?} does not divide {height} x {width}", self.0);
        }
        each_image(image, layout, |image| engine::max_pool(image, self.0))
    }
    fn bwd(&self, image: &Tensor, result: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let [n, blocks, height, width] = image_dims(image.shape())?;
        let by_image = with_numbers(image, |pixels| {
            with_numbers(result, |result| {
                with_numbers(gradient, |gradient| {
                    let (len, out_len) = (height * width, height * width / (self.0[0] * self.0[1]));
                    let of_plane = |i: usize| {
                        let out = i * out_len..(i + 1) * out_len;
                        let pixels = &features(pixels)[i * len..][..len];
                        let (result, gradient) = (&features(result)[out.clone()], &features(gradient)[out]);
                        engine::max_pool_gradient(pixels, result, gradient, width, self.0)
                    };
                    Ok((0..n * blocks).into_par_iter().map(of_plane).collect::<Vec<_>>().concat())
                })
            })
        })?;
        Tensor::from_vec(by_image.into_flattened(), image.shape(), image.device()).map(Some)
    }
}

struct Upsample([usize; 2]);

impl CustomOp1 for Upsample {
    fn name(&self) -> &'static str {
        "upsample"
    }
    fn cpu_fwd(&self, image: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, candle_core::Shape)> {
        each_image(image, layout, |image| engine::upsample(image, self.0))
    }
    fn bwd(&self, image: &Tensor, result: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let [n, blocks, height, width] = image_dims(result.shape())?;
        let by_image = with_numbers(gradient, |gradient| {
            let len = height * width;
            let of_plane = |i: usize| engine::upsample_gradient(&features(gradient)[i * len..][..len], width, self.0);
            Ok((0..n * blocks).into_par_iter().map(of_plane).collect::<Vec<_>>().concat())
        })?;
        Tensor::from_vec(by_image.into_flattened(), image.shape(), image.device()).map(Some)
    }
}
