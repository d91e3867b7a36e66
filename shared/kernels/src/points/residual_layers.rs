//! Two layers with a residual, in one pass over the rows: the operation of `WaffleIron` at each point, in evaluation.

use super::activation::Activation;
use super::layer::Layer;
use super::lists::Lists;
use super::rows::{for_each_block, values, values_mut};
use candle_core::{CpuStorage, InplaceOp2, Layout, Result, Tensor, bail};

/// Rows of a block: with the values between the layers they stay in the first-level cache.
const BLOCK: usize = 48;

/// `x = rows + cells[cell of the row]`, then `x + second(relu(first(x)))`: replaces the rows. `cell_of` has one cell for each row.
pub fn add_residual_layers(rows: &Tensor, cells: &Tensor, cell_of: &Lists, layers: [&Layer; 2]) -> Result<()> {
    rows.inplace_op2(cells, &ResidualLayers { cell_of, layers })
}

struct ResidualLayers<'a> {
    cell_of: &'a Lists,
    layers: [&'a Layer; 2],
}

impl InplaceOp2 for ResidualLayers<'_> {
    fn name(&self) -> &'static str {
        "residual-layers"
    }
    fn cpu_fwd(&self, rows: &mut CpuStorage, layout: &Layout, cells: &CpuStorage, of_cells: &Layout) -> Result<()> {
        let (n, width) = layout.shape().dims2()?;
        let (n_cells, cell_width) = of_cells.shape().dims2()?;
        let [first, second] = self.layers;
        let (n_in, n_hidden) = first.shape();
        let (n_back, n_out) = second.shape();
        let fits = (n_in, n_hidden, cell_width, n_out) == (width, n_back, width, width);
        if !fits || (n, n_cells) != (self.cell_of.len(), self.cell_of.n_rows()) || self.cell_of.n_items() != n {
            bail!(
                "residual layers: rows {:?}, cells {:?}, layers {:?}",
                (n, width),
                (n_cells, cell_width),
                (first.shape(), second.shape())
            );
        }
        let rows = values_mut(rows, layout)?;
        let cells = values(cells, of_cells)?;
        for_each_block(rows, width, BLOCK, |block, rows| {
            for (row, values) in rows.chunks_exact_mut(width).enumerate() {
                let cell = self.cell_of.item(block + row) as usize;
                values.iter_mut().zip(&cells[cell * width..][..width]).for_each(|(value, cell)| *value += cell);
            }
            let mut hidden = vec![0.0; rows.len() / width * n_hidden];
            first.add_bias(&mut hidden);
            first.add_product(rows, &mut hidden);
            Activation::RELU.apply(&mut hidden);
            second.add_bias(rows);
            second.add_product(&hidden, rows);
        });
        Ok(())
    }
}
