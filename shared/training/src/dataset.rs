//! Labeled inputs of networks.

use kernels::images::Planes;
use random::Random;

/// Class of a pixel or point without a label; losses and scores ignore it.
pub const UNKNOWN: u8 = u8::MAX;

/// A labeled input of a network on images.
pub struct Example {
    /// The input. Each of its columns holds `fold` columns of the labels.
    pub input: Planes,
    /// Class by row and column, [`UNKNOWN`] without a label; it has `fold` times as many columns as the input.
    pub truth: Vec<u8>,
    /// View for training with consistency under dropped beams.
    pub sparse_view: Option<SparseView>,
    /// Labels for training with a head on the bird's-eye view.
    pub bev: Option<BevLabels>,
}

impl Example {
    /// An example without a sparse view or cell labels.
    pub fn new(input: Planes, truth: Vec<u8>) -> Self {
        Self { input, truth, sparse_view: None, bev: None }
    }
}

/// The sweep of an example with fewer rings and points.
pub struct SparseView {
    /// The input, as in [`Example::input`]; it may have fewer rows.
    pub input: Planes,
    /// Pixel pairs that show the same point: in this view, and in the example.
    pub pixels: Vec<[u32; 2]>,
}

/// Top view of the sweep of an example: a square grid.
pub struct BevLabels {
    /// Number of cells per row, and number of rows.
    pub side: usize,
    /// Cell of each pixel of the example, [`NO_CELL`] for pixels without a point or outside the grid.
    pub cells: Vec<u32>,
    /// Class of each cell, row by row, [`UNKNOWN`] without a labeled point.
    pub truth: Vec<u8>,
}

/// Cell of a pixel outside every cell of the grid.
pub const NO_CELL: u32 = u32::MAX;

/// A labeled input of a network on points.
pub struct PointExample {
    /// Positions relative to the center of a sphere, m.
    pub positions: Vec<[f32; 3]>,
    /// Features, one point after the other.
    pub features: Vec<f32>,
    /// Class by point, [`UNKNOWN`] without a label.
    pub truth: Vec<u8>,
}

/// Examples: images of equal size, or spheres of points.
pub trait Dataset<E = Example>: Sync {
    /// Number of examples.
    fn len(&self) -> usize;
    /// Whether there are no examples.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// One example, augmented if random numbers are given.
    fn example(&self, index: usize, random: Option<&mut Random>) -> E;
}
