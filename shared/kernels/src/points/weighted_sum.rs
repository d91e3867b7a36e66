//! Weighted sums of the rows of lists: gather, mean of cells, interpolation.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::lists::{Lists, Transposed};
use super::rows::{for_each_block, values};
use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor, bail};
use std::sync::Arc;

/// Rows of a task.
const BLOCK: usize = 64;

/// The sum of the rows of each list, each row times the weight of its item; 1 without weights. An empty list gives zeros.
pub fn weighted_sum(rows: &Tensor, lists: &Arc<Lists>, weights: Option<&Arc<Vec<f32>>>) -> Result<Tensor> {
    if weights.is_some_and(|weights| weights.len() != lists.n_items()) {
        bail!("weighted sum: {} items need as many weights", lists.n_items());
    }
    let sum = WeightedSum { lists: lists.clone(), weights: weights.cloned(), transposed: false };
    rows.contiguous()?.apply_op1(sum)
}

#[derive(Clone)]
struct WeightedSum {
    lists: Arc<Lists>,
    weights: Option<Arc<Vec<f32>>>,
    /// Whether the inputs are the outputs of the lists: the gradient.
    transposed: bool,
}

impl CustomOp1 for WeightedSum {
    fn name(&self) -> &'static str {
        "weighted-sum"
    }
    fn cpu_fwd(&self, rows: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (n_rows, n_columns) = layout.shape().dims2()?;
        let rows = values(rows, layout)?;
        let (lists, places) = if self.transposed {
            let Transposed { lists, places } = self.lists.transposed();
            (lists, Some(places))
        } else {
            (&*self.lists, None)
        };
        if n_rows != lists.n_rows() {
            bail!("weighted sum: {n_rows} rows, lists of {} rows", lists.n_rows());
        }
        let mut out = vec![0.0_f32; lists.len() * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            wide_loops::run(
                #[inline(always)]
                || {
                    for (list, out) in out.chunks_exact_mut(n_columns).enumerate() {
                        for place in lists.places(first + list) {
                            let row = lists.item(place) as usize;
                            let row = &rows[row * n_columns..(row + 1) * n_columns];
                            let weighted = places.map_or(place, |places| places[place] as usize);
                            let weight = self.weights.as_ref().map_or(1.0, |weights| weights[weighted]);
                            for c in 0..n_columns {
                                out[c] += weight * row[c];
                            }
                        }
                    }
                },
            );
        });
        Ok((CpuStorage::F32(out), (lists.len(), n_columns).into()))
    }
    fn bwd(&self, _: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let back = Self { transposed: !self.transposed, ..self.clone() };
        gradient.contiguous()?.apply_op1_no_bwd(&back).map(Some)
    }
}
