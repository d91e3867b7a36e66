//! Neighborhoods of pixels.

/// Neighborhood of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    /// Four neighbors, across edges.
    Four,
    /// Eight neighbors, across edges and corners.
    Eight,
}

impl Connectivity {
    /// Offsets (row, column) of the neighbors before a pixel in raster order. The offsets of the others are their negatives.
    pub(crate) const fn before(self) -> &'static [(isize, isize)] {
        match self {
            Connectivity::Four => &[(-1, 0), (0, -1)],
            Connectivity::Eight => &[(-1, -1), (-1, 0), (-1, 1), (0, -1)],
        }
    }
}

/// Size of an image, for access by flat indices.
#[derive(Clone, Copy)]
pub(crate) struct Raster {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
}

impl Raster {
    pub(crate) fn new((rows, cols): (usize, usize)) -> Self {
        assert!(
            rows * cols < u32::MAX as usize,
            "image of {rows} x {cols} pixels is too large; at most 2^32 - 2 pixels are supported"
        );
        Self { rows, cols }
    }

    /// Flat index of the pixel at `offset` from `pixel`, `None` outside.
    #[inline]
    pub(crate) fn neighbor(self, pixel: usize, offset: (isize, isize)) -> Option<usize> {
        let row = (pixel / self.cols).checked_add_signed(offset.0)?;
        let col = (pixel % self.cols).checked_add_signed(offset.1)?;
        (row < self.rows && col < self.cols).then_some(row * self.cols + col)
    }

    /// All neighbors of `pixel` inside the image.
    pub(crate) fn neighbors(self, pixel: usize, connectivity: Connectivity) -> impl Iterator<Item = usize> {
        let before = connectivity.before().iter().copied();
        let after = connectivity.before().iter().rev().map(|&(row, col)| (-row, -col));
        before.chain(after).filter_map(move |offset| self.neighbor(pixel, offset))
    }
}
