//! A linear layer that is packed once, for operations of several layers in evaluation.

use super::product::{Matrix, Packed};
use super::rows::read;
use candle_core::{Result, Tensor, bail};

/// A linear layer.
pub struct Layer {
    weight: Packed,
    n_in: usize,
    bias: Vec<f32>,
}

impl Layer {
    /// Creates a layer from weight `(out, in)` and bias `(out)`.
    pub fn new(weight: &Tensor, bias: &Tensor) -> Result<Self> {
        let (n_out, n_in) = weight.dims2()?;
        if bias.dims() != [n_out] {
            bail!("linear layer: weight {:?}, bias {:?}", weight.shape(), bias.shape());
        }
        let weight = read(weight, |weight| Packed::new(Matrix::from_rows(weight, n_in).transposed(), n_in, n_out))?;
        Ok(Self { weight, n_in, bias: bias.to_vec1()? })
    }
    /// Columns of the input and of the output.
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.n_in, self.bias.len())
    }
    /// Adds the bias to rows.
    pub(super) fn add_bias(&self, rows: &mut [f32]) {
        for row in rows.chunks_exact_mut(self.bias.len()) {
            row.iter_mut().zip(&self.bias).for_each(|(value, bias)| *value += bias);
        }
    }
    /// Adds the products of `rows` with the weight to `out`.
    pub(super) fn add_product(&self, rows: &[f32], out: &mut [f32]) {
        self.weight.add_product(Matrix::from_rows(rows, self.n_in), out);
    }
}
