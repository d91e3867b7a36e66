//! The classes of a sweep seen from above, for an auxiliary head on the bird's-eye view.

use super::labeled_image::LabeledImage;
use std::cmp::Reverse;
use training::{BevLabels, NO_CELL, UNKNOWN};

/// Side of the square around the LiDAR, as in LiDOG, m.
const SIDE_M: f32 = 50.0;
/// Side of a cell, m: at this size, poles and pedestrians still have their own cells.
const CELL_M: f32 = 0.5;
/// Cells of a row.
const SIDE: usize = (SIDE_M / CELL_M) as usize;

/// The cell of each pixel, and the most frequent class of each cell. Of equally frequent classes, the first counts.
pub fn bev_labels(LabeledImage { image, truth }: &LabeledImage, n_classes: usize) -> BevLabels {
    let cells: Vec<u32> =
        image.pixels.iter().map(|pixel| if pixel.is_valid() { cell_of(pixel.ray) } else { NO_CELL }).collect();
    let mut counts = vec![0_u32; SIDE * SIDE * n_classes];
    for (&cell, &class) in cells.iter().zip(truth).filter(|(cell, class)| **cell != NO_CELL && **class != UNKNOWN) {
        counts[cell as usize * n_classes + usize::from(class)] += 1;
    }
    let most_frequent = |counts: &[u32]| {
        let (class, n) = (0_u8..).zip(counts).max_by_key(|&(class, n)| (n, Reverse(class)))?;
        (*n > 0).then_some(class)
    };
    let truth = counts.chunks_exact(n_classes).map(|counts| most_frequent(counts).unwrap_or(UNKNOWN)).collect();
    BevLabels { side: SIDE, cells, truth }
}

/// The cell of a point: row by x, column by y.
fn cell_of([x, y, _]: [f32; 3]) -> u32 {
    let [row, column] = [x, y].map(|v| ((v + 0.5 * SIDE_M) / CELL_M).floor());
    let inside = 0.0..SIDE as f32;
    if inside.contains(&row) && inside.contains(&column) { row as u32 * SIDE as u32 + column as u32 } else { NO_CELL }
}

#[cfg(test)]
mod tests {
    use super::*;
    use segmentation::spherical::{PolarImage, PolarPixel};

    #[test]
    fn cells_have_the_most_frequent_class_of_their_pixels() {
        let rays = [[0.1, 0.1, 5.0], [0.4, 0.2, 0.0], [0.3, 0.3, 1.0], [0.2, -0.1, 0.0], [0.0; 3], [-24.9, 24.9, 0.0]];
        let more = [[25.1, 0.0, 0.0], [0.0, -25.1, 0.0], [3.1, 0.0, 0.0], [3.2, 0.0, 0.0]];
        let pixel = |&ray: &[f32; 3]| PolarPixel { ray, ..PolarPixel::default() };
        let pixels: Vec<PolarPixel> = rays.iter().chain(&more).map(pixel).collect();
        let image = PolarImage { rows: 1, columns: 10, pixels, has_intensity: false, camera: Vec::new() };
        let truth = vec![2, 1, 1, UNKNOWN, 0, 0, 0, 0, 2, 1];
        let labels = bev_labels(&LabeledImage { image, truth }, 3);
        let middle = 50 * 100 + 50;
        assert_eq!(labels.cells[..5], [middle, middle, middle, middle - 1, NO_CELL]);
        assert_eq!(labels.cells[5..8], [99, NO_CELL, NO_CELL]);
        assert_eq!((labels.side, labels.truth.len()), (100, 10_000));
        let class = |pixel: usize| labels.truth[labels.cells[pixel] as usize];
        assert_eq!([0, 3, 5, 8].map(class), [1, UNKNOWN, 0, 1], "1 and 2 are equally frequent in the last cell");
        assert_eq!(labels.truth.iter().filter(|class| **class != UNKNOWN).count(), 3);
    }
}
