//! Linear layer, followed by an activation.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::activation::Activation;
use super::product::{Matrix, Packed};
use super::rows::{column_sums, for_each_block, read, tensor, values};
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor, bail};
use rayon::prelude::*;

/// Rows of a task.
const BLOCK: usize = 128;
/// Parts of the gradient of the weights.
const PARTS: usize = 8;

/// `activation(rows x weight^T + bias)`: rows `(n, in)`, weight `(out, in)`, bias `(out)`.
pub fn linear(rows: &Tensor, weight: &Tensor, bias: &Tensor, activation: Activation) -> Result<Tensor> {
    rows.contiguous()?.apply_op3(&weight.contiguous()?, &bias.contiguous()?, Linear(activation))
}

struct Linear(Activation);

impl CustomOp3 for Linear {
    fn name(&self) -> &'static str {
        "linear-rows"
    }
    fn cpu_fwd(
        &self,
        rows: &CpuStorage,
        rows_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (n, n_in) = rows_layout.shape().dims2()?;
        let (n_out, of_weight) = weight_layout.shape().dims2()?;
        if of_weight != n_in || bias_layout.dims() != [n_out] {
            bail!("linear layer: rows {:?}, weight {:?}, bias {:?}", (n, n_in), (n_out, of_weight), bias_layout.dims());
        }
        let rows = values(rows, rows_layout)?;
        let weight = values(weight, weight_layout)?;
        let bias = values(bias, bias_layout)?;
        let right = Packed::new(Matrix::from_rows(weight, n_in).transposed(), n_in, n_out);
        Ok((CpuStorage::F32(products(rows, n, n_in, &right, Some(bias), self.0)), (n, n_out).into()))
    }
    fn bwd(
        &self,
        rows: &Tensor,
        weight: &Tensor,
        bias: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let gradient = self.0.gradient(result, gradient)?;
        let (n, n_in) = rows.dims2()?;
        let n_out = weight.dim(0)?;
        let of_rows = || {
            let right = read(weight, |weight| Packed::new(Matrix::from_rows(weight, n_in), n_out, n_in))?;
            tensor(read(&gradient, |g| products(g, n, n_out, &right, None, Activation::NONE))?, (n, n_in))
        };
        let of_weight = || {
            let sums = |g: &[f32], rows: &[f32]| transposed_product(g, rows, n, n_out, n_in);
            tensor(read(&gradient, |g| read(rows, |rows| sums(g, rows)))??, (n_out, n_in))
        };
        Ok((
            rows.track_op().then(of_rows).transpose()?,
            weight.track_op().then(of_weight).transpose()?,
            bias.track_op().then(|| row_sum(&gradient)).transpose()?,
        ))
    }
}

/// The products of `n` rows with a matrix, in parallel.
fn products(
    rows: &[f32],
    n: usize,
    depth: usize,
    right: &Packed,
    bias: Option<&[f32]>,
    activation: Activation,
) -> Vec<f32> {
    let n_out = right.n_columns();
    let mut out = vec![0.0; n * n_out];
    for_each_block(&mut out, n_out, BLOCK, |first, out| {
        if let Some(bias) = bias {
            out.chunks_exact_mut(n_out).for_each(|row| row.copy_from_slice(bias));
        }
        right.add_product(Matrix::from_rows(&rows[first * depth..], depth), out);
        activation.apply(out);
    });
    out
}

/// `a^T x b` of matrices with `n` rows: fixed parts of the rows, added in order.
pub(super) fn transposed_product(a: &[f32], b: &[f32], n: usize, a_columns: usize, b_columns: usize) -> Vec<f32> {
    let part = n.div_ceil(PARTS).next_multiple_of(BLOCK);
    let of_part = |start: usize| {
        let mut out = vec![0.0; a_columns * b_columns];
        let mut right = Packed::new(Matrix::from_rows(&[], b_columns), 0, b_columns);
        for first in (start..(start + part).min(n)).step_by(BLOCK) {
            let rows = BLOCK.min(n - first);
            right.pack(Matrix::from_rows(&b[first * b_columns..], b_columns), rows, b_columns);
            right.add_product(Matrix::from_rows(&a[first * a_columns..], a_columns).transposed(), &mut out);
        }
        out
    };
    sum_parts((0..n).step_by(part.max(1)).collect::<Vec<_>>().into_par_iter().map(of_part), a_columns * b_columns)
}

/// The sum of parts, added in order.
pub(super) fn sum_parts(parts: impl IndexedParallelIterator<Item = Vec<f32>>, len: usize) -> Vec<f32> {
    let parts: Vec<Vec<f32>> = parts.collect();
    let mut parts = parts.into_iter();
    let mut total = parts.next().unwrap_or_else(|| vec![0.0; len]);
    for part in parts {
        total.iter_mut().zip(part).for_each(|(total, part)| *total += part);
    }
    total
}

/// The sum of all rows.
pub(super) fn row_sum(rows: &Tensor) -> Result<Tensor> {
    let (n, n_columns) = rows.dims2()?;
    let of_values = |values: &[f32]| {
        column_sums(
            n,
            n_columns,
            #[inline(always)]
            |row, sums| {
                let row = &values[row * n_columns..(row + 1) * n_columns];
                for c in 0..n_columns {
                    sums[c] += f64::from(row[c]);
                }
            },
        )
    };
    tensor(read(rows, of_values)?.into_iter().map(|sum| sum as f32).collect(), n_columns)
}
