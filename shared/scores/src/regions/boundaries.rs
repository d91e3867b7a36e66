//! Boundaries of regions against those of a segmentation.

use super::LabelImage;

/// How the boundaries of superpixels fit those of a segmentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryScores {
    /// Share of the segmentation's boundary pixels with a superpixel boundary near. 0 without boundaries.
    pub recall: f64,
    /// Share of true among all positive: found boundary pixels of the segmentation, and superpixel boundaries without one of the
    /// segmentation near.
    pub precision: f64,
}

/// Share of pixels with one of four neighbors of another label: both sides of a contour count, as in the benchmark.
pub fn contour_density(image: &LabelImage<'_>) -> f64 {
    boundary(image).iter().filter(|pixel| **pixel).count() as f64 / image.labels.len() as f64
}

/// Compares boundaries. Near: at most `distance` px in x and in y. The thesis has 2, the benchmark 0.0025 of the diagonal, rounded.
/// Both images must have the same size.
pub fn boundary_scores(superpixels: &LabelImage<'_>, segmentation: &LabelImage<'_>, distance: usize) -> BoundaryScores {
    let (found, truth) = (boundary(superpixels), boundary(segmentation));
    let near_found = widened(&found, superpixels.columns, distance);
    let near_truth = widened(&truth, segmentation.columns, distance);
    let (mut n_truth, mut n_recalled, mut n_false) = (0_u64, 0_u64, 0_u64);
    for (at, is_true) in truth.iter().enumerate() {
        n_truth += u64::from(*is_true);
        n_recalled += u64::from(*is_true && near_found[at]);
        n_false += u64::from(!is_true && found[at] && !near_truth[at]);
    }
    let share = |part: u64, all: u64| if all > 0 { part as f64 / all as f64 } else { 0.0 };
    BoundaryScores { recall: share(n_recalled, n_truth), precision: share(n_recalled, n_recalled + n_false) }
}

fn boundary(image: &LabelImage<'_>) -> Vec<bool> {
    (0..image.labels.len()).map(|at| image.foreign_neighbors(at)[0] > 0).collect()
}

/// Pixels at most `distance` px in x and in y from a marked one.
fn widened(marks: &[bool], columns: usize, distance: usize) -> Vec<bool> {
    let rows = marks.len() / columns;
    let along = |marks: &[bool], n: usize, index: &dyn Fn(usize, usize) -> usize, n_lines: usize| {
        let mut widened = vec![false; marks.len()];
        for line in 0..n_lines {
            for at in (0..n).filter(|at| marks[index(line, *at)]) {
                (at.saturating_sub(distance)..n.min(at + distance + 1)).for_each(|near| widened[index(line, near)] = true);
            }
        }
        widened
    };
    let in_rows = along(marks, columns, &|row, column| row * columns + column, rows);
    along(&in_rows, rows, &|column, row| row * columns + column, columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two halves of a 10 x 4 image, divided left of a column.
    fn halves(column: usize) -> Vec<u32> {
        (0..40).map(|at| u32::from(at % 10 >= column)).collect()
    }

    #[test]
    fn shifted_boundary_counts_up_to_the_distance() {
        let (truth, found) = (halves(4), halves(7));
        let [truth, found] = [&truth, &found].map(|labels| LabelImage::new(10, labels).expect("an image"));
        // Boundary pixels: columns 3 and 4, and 6 and 7.
        let at = |distance| boundary_scores(&found, &truth, distance);
        assert_eq!(at(1), BoundaryScores { recall: 0.0, precision: 0.0 });
        assert_eq!(at(2), BoundaryScores { recall: 0.5, precision: 0.5 });
        assert_eq!(at(3), BoundaryScores { recall: 1.0, precision: 1.0 });
        assert_eq!(contour_density(&found), 0.2);
    }
}
