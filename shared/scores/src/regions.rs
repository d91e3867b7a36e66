//! Scores of the regions of a label image: shapes, and superpixels compared with segmentations by people.
//!
//! Definitions: thesis 3.3.2; "benchmark": the superpixel benchmark of Stutz et al. (CVIU 2018), whose values they equal.

mod boundaries;
mod overlap;
mod shapes;

pub use boundaries::{BoundaryScores, ContourDensity, boundary_scores, contour_density};
pub use overlap::{OverlapScores, explained_variation, overlap_scores};
pub use shapes::{Shapes, shapes};

/// A label image: rows of columns. Equal labels are one region, connected or not. Label 0 is also a region.
#[derive(Clone, Copy, Debug)]
pub struct LabelImage<'a> {
    columns: usize,
    labels: &'a [u32],
}

impl<'a> LabelImage<'a> {
    /// Creates the image; `None` if the labels do not fill the rows, or a label is not below the number of pixels + 1.
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

    /// Number of connected parts of regions, by four neighbors.
    pub fn n_parts(&self) -> usize {
        let mut is_visited = vec![false; self.labels.len()];
        let mut open = Vec::new();
        let mut n_parts = 0;
        for start in 0..self.labels.len() {
            n_parts += usize::from(!is_visited[start]);
            open.push(start);
            while let Some(at) = open.pop() {
                if !std::mem::replace(&mut is_visited[at], true) {
                    let is_same = |neighbor: &usize| self.labels[*neighbor] == self.labels[at];
                    open.extend(self.neighbors(at).into_iter().flatten().filter(is_same));
                }
            }
        }
        n_parts
    }

    fn rows(&self) -> usize {
        self.labels.len() / self.columns
    }

    /// Number of pixels per label.
    fn areas(&self) -> Vec<u64> {
        let n_labels = self.labels.iter().max().map_or(0, |label| *label as usize + 1);
        let mut areas = vec![0; n_labels];
        for label in self.labels {
            areas[*label as usize] += 1;
        }
        areas
    }

    /// Left, right, upper and lower neighbor; `None` outside the image.
    fn neighbors(&self, at: usize) -> [Option<usize>; 4] {
        let x = at % self.columns;
        let y = at / self.columns;
        [
            (x > 0).then(|| at - 1),
            (x + 1 < self.columns).then_some(at + 1),
            (y > 0).then(|| at - self.columns),
            (y + 1 < self.rows()).then_some(at + self.columns),
        ]
    }

    /// Number of sides of a pixel that face another label or the edge of the image.
    fn open_sides(&self, at: usize) -> [u32; 2] {
        let mut counts = [0; 2];
        for neighbor in self.neighbors(at) {
            match neighbor {
                Some(neighbor) => counts[0] += u32::from(self.labels[neighbor] != self.labels[at]),
                None => counts[1] += 1,
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_connected_by_sides() {
        let labels = [1, 2, 2, 1, 1, 2, 1, 2, 1];
        let image = LabelImage::new(3, &labels).expect("an image");
        assert_eq!((image.n_regions(), image.n_parts()), (2, 4));
        assert!(LabelImage::new(2, &labels).is_none() && LabelImage::new(3, &[10; 9]).is_none());
    }
}
