//! Access to the values of tensors, and sums over rows.

use candle_core::{CpuStorage, Device, Layout, Result, Shape, Storage, Tensor, bail};
use rayon::prelude::*;

/// Rows of a part of a sum. Fixed, so that sums do not depend on the number of threads.
pub(super) const PART: usize = 1024;

/// The values of a contiguous `f32` argument of an operation.
pub(super) fn values<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let CpuStorage::F32(values) = storage else { bail!("operations on points need f32 tensors") };
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&values[start..end]),
        None => bail!("operations on points need contiguous tensors"),
    }
}

/// The values of a contiguous `f32` argument that an operation changes.
pub(super) fn values_mut<'a>(storage: &'a mut CpuStorage, layout: &Layout) -> Result<&'a mut [f32]> {
    let CpuStorage::F32(values) = storage else { bail!("operations on points need f32 tensors") };
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&mut values[start..end]),
        None => bail!("operations on points need contiguous tensors"),
    }
}

/// Calls `work` with the values of a tensor.
pub(super) fn read<R>(tensor: &Tensor, work: impl FnOnce(&[f32]) -> R) -> Result<R> {
    let tensor = tensor.contiguous()?;
    let (storage, layout) = tensor.storage_and_layout();
    let Storage::Cpu(storage) = &*storage else { bail!("operations on points run on the CPU") };
    Ok(work(values(storage, layout)?))
}

/// A tensor of these values.
pub fn tensor(values: Vec<f32>, shape: impl Into<Shape>) -> Result<Tensor> {
    Tensor::from_vec(values, shape.into(), &Device::Cpu)
}

/// Sums over the rows by column, in `f64`: fixed parts, added in order. `add` adds a row to the sums; it must be `#[inline(always)]`.
#[inline(always)]
pub(super) fn column_sums(n_rows: usize, n_columns: usize, add: impl Fn(usize, &mut [f64]) + Sync) -> Vec<f64> {
    let of_part = |part: usize| {
        let mut sums = vec![0.0; n_columns];
        wide_loops::run(
            #[inline(always)]
            || {
                for row in part * PART..((part + 1) * PART).min(n_rows) {
                    add(row, &mut sums);
                }
            },
        );
        sums
    };
    let parts: Vec<Vec<f64>> = (0..n_rows.div_ceil(PART)).into_par_iter().map(of_part).collect();
    let mut total = vec![0.0; n_columns];
    for part in parts {
        total.iter_mut().zip(part).for_each(|(total, part)| *total += part);
    }
    total
}

/// Calls `work` with each block of `n_rows` rows of the output and its first row, in parallel.
pub(super) fn for_each_block(
    out: &mut [f32],
    n_columns: usize,
    n_rows: usize,
    work: impl Fn(usize, &mut [f32]) + Sync + Send,
) {
    if n_columns > 0 {
        out.par_chunks_mut(n_columns * n_rows).enumerate().for_each(|(block, out)| work(block * n_rows, out));
    }
}
