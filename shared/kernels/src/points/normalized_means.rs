//! Means of the rows of lists with a batch normalization, in evaluation.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::lists::Lists;
use super::rows::{for_each_block, values};
use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor, bail};
use std::sync::Arc;

/// Rows of a task.
const BLOCK: usize = 64;

/// The means of the rows of each list, times `scale` and plus `shift`, which is the mean of normalized rows in
/// evaluation. An empty list gives zeros.
pub fn normalized_means(rows: &Tensor, lists: &Arc<Lists>, scale: &Tensor, shift: &Tensor) -> Result<Tensor> {
    let op = NormalizedMeans { lists: lists.clone(), scale: scale.to_vec1()?, shift: shift.to_vec1()? };
    rows.contiguous()?.apply_op1_no_bwd(&op)
}

struct NormalizedMeans {
    lists: Arc<Lists>,
    scale: Vec<f32>,
    shift: Vec<f32>,
}

impl CustomOp1 for NormalizedMeans {
    fn name(&self) -> &'static str {
        "normalized-means"
    }
    fn cpu_fwd(&self, rows: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (n_rows, n_columns) = layout.shape().dims2()?;
        let rows = values(rows, layout)?;
        if n_rows != self.lists.n_rows() || [self.scale.len(), self.shift.len()] != [n_columns; 2] {
            bail!("means: {n_rows} rows of {n_columns}, lists of {} rows", self.lists.n_rows());
        }
        let scale = &self.scale[..n_columns];
        let shift = &self.shift[..n_columns];
        let mut out = vec![0.0_f32; self.lists.len() * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            wide_loops::run(
                #[inline(always)]
                || {
                    for (list, out) in out.chunks_exact_mut(n_columns).enumerate() {
                        let list = self.lists.get(first + list);
                        for row in list {
                            let row = &rows[*row as usize * n_columns..][..n_columns];
                            for c in 0..n_columns {
                                out[c] += row[c];
                            }
                        }
                        if !list.is_empty() {
                            let per_row = 1.0 / list.len() as f32;
                            for c in 0..n_columns {
                                out[c] = out[c] * per_row * scale[c] + shift[c];
                            }
                        }
                    }
                },
            );
        });
        Ok((CpuStorage::F32(out), (self.lists.len(), n_columns).into()))
    }
}
