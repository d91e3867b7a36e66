//! A filter in `PyTorch`'s order as the kernels read it.

use super::tensors::{features, numbers, with_numbers};
use crate::engine::{LANES, Shape};
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Tensor, bail};

/// Weights `[out, in, row, column]` and biases `[out]` as one vector in the kernels' order.
///
/// # Errors
/// If the numbers are not as many as the shape says.
pub fn pack(weights: &Tensor, biases: &Tensor, shape: &Shape) -> Result<Tensor> {
    weights.contiguous()?.apply_op2(&biases.contiguous()?, Pack(shape.clone()))
}

struct Pack(Shape);

impl Pack {
    /// Place of each weight, in their order.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let n_in: usize = self.0.in_channels.iter().sum();
        let [rows, columns] = self.0.kernel;
        (0..self.0.out_channels * n_in * rows * columns).map(move |i| {
            let (input, out) = (i / (rows * columns) % n_in, i / (rows * columns * n_in));
            self.0.place(out, input, [i / columns % rows, i % columns])
        })
    }
    fn bias_places(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.0.out_channels).map(|out| self.0.bias_place(out))
    }
}

impl CustomOp2 for Pack {
    fn name(&self) -> &'static str {
        "pack"
    }
    fn cpu_fwd(
        &self,
        weights: &CpuStorage,
        weights_layout: &Layout,
        biases: &CpuStorage,
        biases_layout: &Layout,
    ) -> Result<(CpuStorage, candle_core::Shape)> {
        let (weights, biases) = (numbers(weights, weights_layout)?, numbers(biases, biases_layout)?);
        let n_weights = self.places().count();
        if weights.len() != n_weights || biases.len() != self.0.out_channels {
            let expected = (n_weights, self.0.out_channels);
            bail!("{} weights and {} biases, expected {expected:?}", weights.len(), biases.len());
        }
        let mut packed = vec![[0.0_f32; LANES]; self.0.packed_rows()];
        for ((row, lane), value) in self.places().chain(self.bias_places()).zip(weights.iter().chain(biases)) {
            packed[row][lane] = *value;
        }
        let n = packed.len() * LANES;
        Ok((CpuStorage::F32(packed.into_flattened()), candle_core::Shape::from(n)))
    }
    fn bwd(
        &self,
        weights: &Tensor,
        biases: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (by_weights, by_biases) = with_numbers(gradient, |gradient| {
            let packed = features(gradient);
            let by_weights: Vec<f32> = self.places().map(|(row, lane)| packed[row][lane]).collect();
            let by_biases: Vec<f32> = self.bias_places().map(|(row, lane)| packed[row][lane]).collect();
            Ok((by_weights, by_biases))
        })?;
        let by_weights = Tensor::from_vec(by_weights, weights.shape(), weights.device())?;
        let by_biases = Tensor::from_vec(by_biases, biases.shape(), biases.device())?;
        Ok((Some(by_weights), Some(by_biases)))
    }
}
