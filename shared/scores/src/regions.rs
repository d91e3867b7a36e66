//! Scores of the regions of a label image: shapes, and superpixels against segmentations by people.
//!
//! Definitions: thesis 3.3.2; "benchmark": the superpixel benchmark of Stutz et al. (CVIU 2018), whose values they equal.

mod boundaries;
mod overlap;
mod shapes;

pub use boundaries::{BoundaryScores, boundary_scores, contour_density};
pub use overlap::{OverlapScores, explained_variation, overlap_scores};
pub use shapes::{Shapes, shapes};

/// A label image: rows of columns. Equal labels are one region, connected or not. Label 0 is a region, too.
#[derive(Clone, Copy, Debug)]
pub struct LabelImage<'a> {
    columns: usize,
    labels: &'a [u32],
}

impl<'a> LabelImage<'a> {
    /// `None` if the labels are no full rows, or a label is not below the number of pixels + 1.
    pub fn new(columns: usize, labels: &'a [u32]) -> Option<Self> {
        let is_valid = columns > 0 && !labels.is_empty() && labels.len().is_multiple_of(columns);
        let is_bounded = labels.iter().all(|label| *label as usize <= labels.len());
        (is_valid && is_bounded).then_some(Self { columns, labels })
    }

    /// Labels row by row.
    pub const fn labels(&self) -> &'a [u32] {
        self.labels
    }

    /// Number of regions with pixels.
    pub fn n_regions(&self) -> usize {
        self.areas().iter().filter(|area| **area > 0).count()
    }

    fn rows(&self) -> usize {
        self.labels.len() / self.columns
    }

    /// By label: number of pixels.
    fn areas(&self) -> Vec<u64> {
        let n_labels = self.labels.iter().max().map_or(0, |label| *label as usize + 1);
        let mut areas = vec![0; n_labels];
        self.labels.iter().for_each(|label| areas[*label as usize] += 1);
        areas
    }

    /// Number of the four neighbors of a pixel with another label, and of those outside the image.
    fn foreign_neighbors(&self, at: usize) -> [u32; 2] {
        let (x, y) = (at % self.columns, at / self.columns);
        let neighbors = [
            (x > 0).then(|| at - 1),
            (x + 1 < self.columns).then_some(at + 1),
            (y > 0).then(|| at - self.columns),
            (y + 1 < self.rows()).then_some(at + self.columns),
        ];
        let mut counts = [0; 2];
        for neighbor in neighbors {
            match neighbor {
                Some(neighbor) => counts[0] += u32::from(self.labels[neighbor] != self.labels[at]),
                None => counts[1] += 1,
            }
        }
        counts
    }
}
