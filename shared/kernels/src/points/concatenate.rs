//! Concatenation of columns. candle's concatenation copies element by element along the last dimension, and so does its
//! gradient.

use super::rows::{for_each_block, read, tensor, values};
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor, bail};

/// Rows of a task.
const BLOCK: usize = 256;

/// The columns of tensors with equal numbers of rows, one after another.
pub fn concatenate(first: &Tensor, others: &[&Tensor]) -> Result<Tensor> {
    let mut all = first.clone();
    for other in others {
        all = all.contiguous()?.apply_op2(&other.contiguous()?, Concatenate)?;
    }
    Ok(all)
}

struct Concatenate;

impl CustomOp2 for Concatenate {
    fn name(&self) -> &'static str {
        "concatenate-columns"
    }
    fn cpu_fwd(&self, a: &CpuStorage, la: &Layout, b: &CpuStorage, lb: &Layout) -> Result<(CpuStorage, Shape)> {
        let (n, a_columns) = la.shape().dims2()?;
        let (n_b, b_columns) = lb.shape().dims2()?;
        if n != n_b {
            bail!("concatenation of {n} and {n_b} rows");
        }
        let a = values(a, la)?;
        let b = values(b, lb)?;
        let n_columns = a_columns + b_columns;
        let mut out = vec![0.0; n * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            for (row, out) in out.chunks_exact_mut(n_columns).enumerate() {
                let row = first + row;
                out[..a_columns].copy_from_slice(&a[row * a_columns..(row + 1) * a_columns]);
                out[a_columns..].copy_from_slice(&b[row * b_columns..(row + 1) * b_columns]);
            }
        });
        Ok((CpuStorage::F32(out), (n, n_columns).into()))
    }
    fn bwd(&self, a: &Tensor, b: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (n, n_columns) = gradient.dims2()?;
        let part = |of: &Tensor, start: usize| -> Result<Tensor> {
            let width = of.dim(1)?;
            let copy = |gradient: &[f32]| {
                let mut out = vec![0.0; n * width];
                for_each_block(&mut out, width, BLOCK, |first, out| {
                    for (row, out) in out.chunks_exact_mut(width).enumerate() {
                        let start = (first + row) * n_columns + start;
                        out.copy_from_slice(&gradient[start..start + width]);
                    }
                });
                out
            };
            tensor(read(gradient, copy)?, (n, width))
        };
        let of_a = a.track_op().then(|| part(a, 0)).transpose()?;
        let of_b = b.track_op().then(|| part(b, a.dim(1)?)).transpose()?;
        Ok((of_a, of_b))
    }
}
