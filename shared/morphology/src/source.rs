//! Rows of an image, possibly only the last.

/// Rows of an image, or its last `span` rows. Row `i` is stored at row `i % span`.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a, T> {
    pub(crate) pixels: &'a [T],
    pub(crate) cols: usize,
    pub(crate) span: usize,
}

impl<'a, T> Source<'a, T> {
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &'a [T] {
        let start = (row % self.span) * self.cols;
        &self.pixels[start..start + self.cols]
    }
}
