//! Connected components of a binary image.

use crate::Connectivity;
use crate::neighbors::Raster;
use crate::union_find::DisjointSets;
use ndarray::Array2;

/// A partition of some pixels into components.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// Label of each pixel: 1, 2 … in raster order of the components' first pixels, 0 for none.
    pub image: Array2<u32>,
    /// Pixels of label `i + 1`.
    pub areas: Vec<usize>,
}

impl Labels {
    /// Number of components.
    pub fn n(&self) -> usize {
        self.areas.len()
    }
    /// Area of a label in pixels, 0 for label 0 and past the last.
    pub fn area(&self, label: u32) -> usize {
        (label as usize).checked_sub(1).and_then(|idx| self.areas.get(idx)).copied().unwrap_or(0)
    }
}

/// Components of the pixels that are `true`.
pub fn connected_components(mask: &Array2<bool>, connectivity: Connectivity) -> Labels {
    let raster = Raster::new(mask.dim());
    let standard = mask.as_standard_layout();
    let inside = standard.as_slice().expect("standard layout was asked for");
    let mut sets = DisjointSets::new(inside.len());
    for pixel in (0..inside.len()).filter(|&pixel| inside[pixel]) {
        for &offset in connectivity.before() {
            if let Some(before) = raster.neighbor(pixel, offset)
                && inside[before]
            {
                sets.union(before, pixel);
            }
        }
    }
    sets.into_labels(mask.dim(), |pixel| inside[pixel])
}
