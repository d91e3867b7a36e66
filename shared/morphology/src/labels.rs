//! Label images.

use ndarray::Array2;

/// Labels of disjoint components of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// Label of each pixel: 1, 2 … in raster order of the first pixels of the components, 0 for no component.
    pub image: Array2<u32>,
    /// Area of each component in pixels: label `i + 1` has index `i`.
    pub areas: Vec<usize>,
}

impl Labels {
    /// Number of components.
    pub fn n(&self) -> usize {
        self.areas.len()
    }
    /// Area of a label in pixels, 0 for label 0 and unknown labels.
    pub fn area(&self, label: u32) -> usize {
        (label as usize).checked_sub(1).and_then(|idx| self.areas.get(idx)).copied().unwrap_or(0)
    }
}
