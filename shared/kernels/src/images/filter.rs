//! Filters of convolutions.

use super::planes::{Feature, LANES, blocks};
use super::shape::{FilterPosition, PlainFilter, Shape};
use super::winograd_filter;

/// Weights and biases in the order in which the kernel reads them: output block, input block, row, column, input channel, each
/// a row of 16 output channels; then the biases.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Shape of the convolution.
    pub shape: Shape,
    packed: Vec<Feature>,
    /// The filter for the Winograd kernel (3 x 3, stride 1); otherwise empty.
    transformed: Vec<Feature>,
}

impl Filter {
    /// Creates a filter from packed values.
    ///
    /// # Panics
    /// If there are not [`Shape::packed_rows`] rows.
    pub fn from_packed(shape: Shape, packed: Vec<Feature>) -> Self {
        assert_eq!(packed.len(), shape.packed_rows());
        let is_tiled = winograd_filter::fits(&shape, 0, 0);
        let transformed = if is_tiled { winograd_filter::transformed(&shape, &packed) } else { Vec::new() };
        Self { shape, packed, transformed }
    }
    /// Creates a filter from weights in the order of `PyTorch`, `[out, in, row, column]`, and biases.
    ///
    /// # Panics
    /// If the number of weights or biases does not match the shape.
    pub fn new(shape: Shape, weights: &[f32], biases: &[f32]) -> Self {
        let n_in: usize = shape.in_channels.iter().sum();
        let [rows, columns] = shape.kernel;
        assert_eq!(weights.len(), shape.out_channels * n_in * rows * columns);
        assert_eq!(biases.len(), shape.out_channels);
        let mut packed = vec![[0.0; LANES]; shape.packed_rows()];
        for (i, &weight) in weights.iter().enumerate() {
            let column = i % columns;
            let row = i / columns % rows;
            let input = i / (rows * columns) % n_in;
            let out = i / (rows * columns * n_in);
            let position = shape.weight_position(out, input, [row, column]);
            packed[position.row][position.lane] = weight;
        }
        for (out, &bias) in biases.iter().enumerate() {
            let FilterPosition { row, lane } = shape.bias_position(out);
            packed[row][lane] = bias;
        }
        Self::from_packed(shape, packed)
    }
    /// Weight `[out, in, row, column]`.
    pub fn weight(&self, out: usize, input: usize, tap: [usize; 2]) -> f32 {
        let FilterPosition { row, lane } = self.shape.weight_position(out, input, tap);
        self.packed[row][lane]
    }
    /// The filter in the order of `PyTorch`.
    pub fn unpacked(&self) -> PlainFilter {
        self.shape.unpacked(&self.packed)
    }
    #[inline(always)]
    pub(super) fn bias(&self, out_block: usize) -> &Feature {
        &self.packed[blocks(self.shape.out_channels) * self.shape.rows_per_block() + out_block]
    }
    /// The 16 rows of one tap.
    #[inline(always)]
    pub(super) fn tap(&self, out_block: usize, tap: usize) -> &[Feature] {
        &self.packed[out_block * self.shape.rows_per_block() + tap * LANES..][..LANES]
    }
    /// The filter for the Winograd kernel; empty if the kernel cannot apply it.
    #[inline(always)]
    pub(super) fn transformed(&self) -> &[Feature] {
        &self.transformed
    }
    /// Multiplications and additions per output pixel, without padding channels.
    pub fn flops_per_pixel(&self) -> usize {
        let n_in: usize = self.shape.in_channels.iter().sum();
        2 * n_in * self.shape.out_channels * self.shape.kernel[0] * self.shape.kernel[1]
    }
}
