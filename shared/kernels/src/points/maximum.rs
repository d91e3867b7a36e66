//! Maximum over the rows of lists, by column.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::lists::Lists;
use super::rows::{for_each_block, read, tensor, values};
use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor, bail};
use std::sync::Arc;

/// Rows of a task.
const BLOCK: usize = 32;

/// The maximum of the rows of each list, by column. Lists shorter than `full` have an additional row of zeros: the
/// shadow neighbor of `KPConv`. An empty list gives zeros. The first of equal values gets the gradient.
pub fn maximum(rows: &Tensor, lists: &Arc<Lists>, full: usize) -> Result<Tensor> {
    rows.contiguous()?.apply_op1(Maximum { lists: lists.clone(), full })
}

struct Maximum {
    lists: Arc<Lists>,
    full: usize,
}

impl CustomOp1 for Maximum {
    fn name(&self) -> &'static str {
        "maximum-of-lists"
    }
    fn cpu_fwd(&self, rows: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (n_rows, n_columns) = layout.shape().dims2()?;
        if n_rows != self.lists.n_rows() {
            bail!("maximum: {n_rows} rows, lists of {} rows", self.lists.n_rows());
        }
        let rows = values(rows, layout)?;
        let mut out = vec![0.0_f32; self.lists.len() * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            wide_loops::run(
                #[inline(always)]
                || {
                    for (list, out) in out.chunks_exact_mut(n_columns).enumerate() {
                        let list = self.lists.get(first + list);
                        if list.len() >= self.full && !list.is_empty() {
                            out.fill(f32::NEG_INFINITY);
                        }
                        for row in list {
                            let row = &rows[*row as usize * n_columns..(*row as usize + 1) * n_columns];
                            for c in 0..n_columns {
                                out[c] = if row[c] > out[c] { row[c] } else { out[c] };
                            }
                        }
                    }
                },
            );
        });
        Ok((CpuStorage::F32(out), (self.lists.len(), n_columns).into()))
    }
    fn bwd(&self, rows: &Tensor, result: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let (n_rows, n_columns) = rows.dims2()?;
        let chosen = read(rows, |rows| read(result, |result| self.chosen(rows, result, n_columns)))??;
        let lists = &self.lists.transposed().lists;
        let gradient = read(gradient, |gradient| {
            let mut out = vec![0.0; n_rows * n_columns];
            for_each_block(&mut out, n_columns, BLOCK, |first, out| {
                wide_loops::run(
                    #[inline(always)]
                    || {
                        for (row, out) in out.chunks_exact_mut(n_columns).enumerate() {
                            let mut last = u32::MAX;
                            for list in lists.get(first + row) {
                                // A row that occurs twice in a list gets its gradient once.
                                if std::mem::replace(&mut last, *list) == *list {
                                    continue;
                                }
                                let start = *list as usize * n_columns;
                                let chosen = &chosen[start..start + n_columns];
                                let gradient = &gradient[start..start + n_columns];
                                for c in 0..n_columns {
                                    out[c] += if chosen[c] as usize == first + row { gradient[c] } else { 0.0 };
                                }
                            }
                        }
                    },
                );
            });
            out
        })?;
        tensor(gradient, (n_rows, n_columns)).map(Some)
    }
}

impl Maximum {
    /// The first row with the maximum, by list and column; `u32::MAX` if it is the row of zeros.
    fn chosen(&self, rows: &[f32], result: &[f32], n_columns: usize) -> Vec<u32> {
        use rayon::prelude::*;
        let mut chosen = vec![u32::MAX; result.len()];
        if n_columns == 0 {
            return chosen;
        }
        chosen.par_chunks_mut(n_columns).with_min_len(BLOCK).enumerate().for_each(|(list, chosen)| {
            let result = &result[list * n_columns..(list + 1) * n_columns];
            wide_loops::run(
                #[inline(always)]
                || {
                    for row in self.lists.get(list).iter().rev() {
                        let values = &rows[*row as usize * n_columns..(*row as usize + 1) * n_columns];
                        for c in 0..n_columns {
                            chosen[c] = if result[c] == values[c] { *row } else { chosen[c] };
                        }
                    }
                },
            );
        });
        chosen
    }
}
