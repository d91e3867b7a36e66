//! Destination of rows of cells.

/// Some cells of a band-sequential cube, starting at `start` in each plane; planes are `stride` values apart. Not an
/// `ndarray` view, because its inner loops run over slices, whose bounds are checked once.
pub(crate) struct Planes<'a> {
    pub values: &'a mut [f32],
    pub stride: usize,
    pub start: usize,
}
