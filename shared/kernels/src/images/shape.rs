//! Shapes of convolutions, and the order of packed filters.

use super::planes::{Feature, LANES, blocks};

/// The shape of a convolution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Rows and columns of the filter: 1, 3 or 5 each.
    pub kernel: [usize; 2],
    /// Stride along the columns: 1 or 2. Output column x is centered on input column `stride_x * x`.
    pub stride_x: usize,
    /// Channels of each source. Sources are concatenated along the channels.
    pub in_channels: Vec<usize>,
    /// Channels of the output.
    pub out_channels: usize,
    /// Whether a rectifier (`ReLU`) follows.
    pub rectify: bool,
}

/// Position of a value in a packed filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilterPosition {
    /// Row of 16 values.
    pub row: usize,
    /// Index in the row.
    pub lane: usize,
}

/// A filter, or the derivative with respect to one, in the order of `PyTorch`.
#[derive(Clone, Debug, PartialEq)]
pub struct PlainFilter {
    /// Weights, `[out, in, row, column]`.
    pub weights: Vec<f32>,
    /// Biases, `[out]`.
    pub biases: Vec<f32>,
}

impl Shape {
    /// Number of blocks of all sources.
    #[inline(always)]
    pub fn in_blocks(&self) -> usize {
        self.in_channels.iter().map(|&channels| blocks(channels)).sum()
    }
    /// Number of rows of 16 weights of one output block.
    #[inline(always)]
    pub(super) fn rows_per_block(&self) -> usize {
        self.in_blocks() * self.kernel[0] * self.kernel[1] * LANES
    }
    /// Number of rows of 16 values of a packed filter: its weights, then its biases.
    pub fn packed_rows(&self) -> usize {
        blocks(self.out_channels) * (self.rows_per_block() + 1)
    }
    /// Position of weight `[out, in, row, column]` (the order of `PyTorch`) in the packed filter.
    pub fn weight_position(&self, out: usize, input: usize, [row, column]: [usize; 2]) -> FilterPosition {
        let mut block = 0;
        let mut channel = input;
        for &channels in &self.in_channels {
            if channel < channels {
                break;
            }
            channel -= channels;
            block += blocks(channels);
        }
        let block = block + channel / LANES;
        let tap = ((out / LANES * self.in_blocks() + block) * self.kernel[0] + row) * self.kernel[1] + column;
        FilterPosition { row: tap * LANES + channel % LANES, lane: out % LANES }
    }
    /// Position of a bias in the packed filter.
    pub fn bias_position(&self, out: usize) -> FilterPosition {
        let row = blocks(self.out_channels) * self.rows_per_block() + out / LANES;
        FilterPosition { row, lane: out % LANES }
    }
    /// The filter in the order of `PyTorch` from a packed one.
    pub fn unpacked(&self, packed: &[Feature]) -> PlainFilter {
        let n_in: usize = self.in_channels.iter().sum();
        let [rows, columns] = self.kernel;
        let weight = |i: usize| {
            let input = i / (rows * columns) % n_in;
            let out = i / (rows * columns * n_in);
            let FilterPosition { row, lane } = self.weight_position(out, input, [i / columns % rows, i % columns]);
            packed[row][lane]
        };
        let bias = |out: usize| {
            let FilterPosition { row, lane } = self.bias_position(out);
            packed[row][lane]
        };
        let n_weights = self.out_channels * n_in * rows * columns;
        PlainFilter {
            weights: (0..n_weights).map(weight).collect(),
            biases: (0..self.out_channels).map(bias).collect(),
        }
    }
    /// Columns of the output.
    pub fn out_width(&self, width: usize) -> usize {
        width / self.stride_x
    }
}
