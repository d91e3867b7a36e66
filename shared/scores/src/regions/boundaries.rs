//! Boundaries of regions compared with boundaries of a segmentation.

use super::LabelImage;

/// Agreement of the boundaries of superpixels with the boundaries of a segmentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryScores {
    /// Share of the segmentation's boundary pixels with a superpixel boundary nearby. 0 without boundaries.
    pub recall: f64,
    /// Share of the superpixels' boundary pixels with a boundary of the segmentation nearby. 0 without boundaries.
    pub precision: f64,
    /// Precision of the benchmark: recalled boundary pixels of the segmentation, divided by the sum of these and the
    /// superpixels' boundary pixels without a boundary nearby.
    pub benchmark_precision: f64,
}

/// Share of the pixels that are on contours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourDensity {
    /// Pixels with another label right of them or below: lines of one pixel.
    pub one_side: f64,
    /// Pixels with one of four neighbors of another label: both sides of a contour, as in the benchmark.
    pub both_sides: f64,
}

/// Density of the contours of an image.
pub fn contour_density(image: &LabelImage<'_>) -> ContourDensity {
    let n_pixels = image.labels.len();
    let differs = |at: usize, neighbor: usize| image.labels[at] != image.labels[neighbor];
    let begins = |at: &usize| {
        let is_last_column = (at + 1).is_multiple_of(image.columns);
        !is_last_column && differs(*at, at + 1) || at + image.columns < n_pixels && differs(*at, at + image.columns)
    };
    ContourDensity {
        one_side: (0..n_pixels).filter(begins).count() as f64 / n_pixels as f64,
        both_sides: boundary(image).iter().filter(|pixel| **pixel).count() as f64 / n_pixels as f64,
    }
}

/// Compares boundaries. They match within `distance` px in x and in y. The thesis uses 2, the benchmark 0.0025 of the
/// diagonal, rounded. Both images must have the same size.
pub fn boundary_scores(superpixels: &LabelImage<'_>, segmentation: &LabelImage<'_>, distance: usize) -> BoundaryScores {
    let found = boundary(superpixels);
    let truth = boundary(segmentation);
    let near_found = widened(&found, superpixels.columns, distance);
    let near_truth = widened(&truth, segmentation.columns, distance);
    let count = |is_counted: &dyn Fn(usize) -> bool| (0..truth.len()).filter(|at| is_counted(*at)).count();
    let n_truth = count(&|at| truth[at]);
    let n_recalled = count(&|at| truth[at] && near_found[at]);
    let n_found = count(&|at| found[at]);
    let n_false = count(&|at| found[at] && !near_truth[at]);
    let share = |part: usize, all: usize| if all > 0 { part as f64 / all as f64 } else { 0.0 };
    BoundaryScores {
        recall: share(n_recalled, n_truth),
        precision: share(n_found - n_false, n_found),
        benchmark_precision: share(n_recalled, n_recalled + n_false),
    }
}

fn boundary(image: &LabelImage<'_>) -> Vec<bool> {
    (0..image.labels.len()).map(|at| image.open_sides(at)[0] > 0).collect()
}

/// Pixels at most `distance` px in x and in y from a marked one.
fn widened(marks: &[bool], columns: usize, distance: usize) -> Vec<bool> {
    let rows = marks.len() / columns;
    let along = |marks: &[bool], n: usize, index: &dyn Fn(usize, usize) -> usize, n_lines: usize| {
        let mut widened = vec![false; marks.len()];
        for line in 0..n_lines {
            for at in (0..n).filter(|at| marks[index(line, *at)]) {
                (at.saturating_sub(distance)..n.min(at + distance + 1))
                    .for_each(|near| widened[index(line, near)] = true);
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
        let truth = halves(4);
        let found = halves(7);
        let [truth, found] = [&truth, &found].map(|labels| LabelImage::new(10, labels).expect("an image"));
        // Boundary pixels: columns 3 and 4, and 6 and 7.
        let at = |distance| boundary_scores(&found, &truth, distance);
        let scores = |share| BoundaryScores { recall: share, precision: share, benchmark_precision: share };
        assert_eq!([at(1), at(2), at(3)], [scores(0.0), scores(0.5), scores(1.0)]);
        assert_eq!(contour_density(&found), ContourDensity { one_side: 0.1, both_sides: 0.2 });
    }

    #[test]
    fn precision_falls_with_false_boundaries() {
        // Boundaries at columns 4 and 8; the truth is at 4.
        let truth = halves(4);
        let found = (0..40).map(|at| u32::from(at % 10 >= 4) + u32::from(at % 10 >= 8)).collect::<Vec<_>>();
        let [truth, found] = [&truth, &found].map(|labels| LabelImage::new(10, labels).expect("an image"));
        let scores = boundary_scores(&found, &truth, 0);
        assert_eq!(scores, BoundaryScores { recall: 1.0, precision: 0.5, benchmark_precision: 0.5 });
    }
}
