//! The embedding of neighborhoods of `WaffleIron`, in evaluation: layers on differences of neighbors, and their maximum, without the
//! rows of all differences in memory.

use super::layer::Layer;
use super::lists::Lists;
use super::rows::{for_each_block, values};
use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor, bail};
use std::sync::Arc;

/// Points of a block: the rows of their neighbors stay in the first-level cache.
const BLOCK: usize = 8;

/// `max over the neighbors j of layer(relu(row j - row i + shift))` for each row i, by column. Each row needs a neighbor.
pub fn neighbor_maximum(rows: &Tensor, shift: Vec<f32>, neighbors: &Arc<Lists>, layer: Layer) -> Result<Tensor> {
    rows.contiguous()?.apply_op1_no_bwd(&NeighborMaximum { shift, neighbors: neighbors.clone(), layer })
}

struct NeighborMaximum {
    shift: Vec<f32>,
    neighbors: Arc<Lists>,
    layer: Layer,
}

impl CustomOp1 for NeighborMaximum {
    fn name(&self) -> &'static str {
        "neighbor-maximum"
    }
    fn cpu_fwd(&self, rows: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (n, width) = layout.shape().dims2()?;
        let (n_in, n_out) = self.layer.shape();
        let neighbors = &self.neighbors;
        if (n, n) != (neighbors.len(), neighbors.n_rows()) || (width, width) != (n_in, self.shift.len()) {
            bail!(
                "neighbor maximum: rows {:?}, {} lists of {} rows, layer {:?}",
                (n, width),
                neighbors.len(),
                neighbors.n_rows(),
                self.layer.shape()
            );
        }
        let rows = values(rows, layout)?;
        let mut out = vec![0.0; n * n_out];
        for_each_block(&mut out, n_out, BLOCK, |first, out| {
            let points = first..first + out.len() / n_out;
            let n_pairs = points.clone().map(|point| neighbors.get(point).len()).sum::<usize>();
            let mut hidden = vec![0.0; n_pairs * width];
            wide_loops::run(
                #[inline(always)]
                || self.hidden(points.clone(), rows, &mut hidden),
            );
            let mut of_pairs = vec![0.0; n_pairs * n_out];
            self.layer.add_product(&hidden, &mut of_pairs);
            wide_loops::run(
                #[inline(always)]
                || {
                    let mut pairs = of_pairs.chunks_exact(n_out);
                    for (point, out) in points.zip(out.chunks_exact_mut(n_out)) {
                        out.fill(f32::NEG_INFINITY);
                        for pair in pairs.by_ref().take(neighbors.get(point).len()) {
                            for (out, value) in out.iter_mut().zip(pair) {
                                *out = if *value > *out { *value } else { *out };
                            }
                        }
                    }
                },
            );
            self.layer.add_bias(out);
        });
        Ok((CpuStorage::F32(out), (n, n_out).into()))
    }
}

impl NeighborMaximum {
    /// The input of the layer for all neighbors of some points.
    #[inline(always)]
    fn hidden(&self, points: std::ops::Range<usize>, rows: &[f32], out: &mut [f32]) {
        let width = self.shift.len();
        let mut out = out.chunks_exact_mut(width);
        for point in points {
            let own = &rows[point * width..][..width];
            for (neighbor, out) in self.neighbors.get(point).iter().zip(out.by_ref()) {
                let row = &rows[*neighbor as usize * width..][..width];
                for (((out, row), own), shift) in out.iter_mut().zip(row).zip(own).zip(&self.shift) {
                    *out = (row - own + shift).max(0.0);
                }
            }
        }
    }
}
