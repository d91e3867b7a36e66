//! Images with limited slope.

use morphology::limit_rise;
use ndarray::Array2;

/// Reproducible pseudo-random numbers from 0 to 1.
fn uneven(row: usize, col: usize) -> f32 {
    ((row * 37 + col * 61) as f32 * 0.618_034).fract()
}

#[test]
fn result_is_the_minimum_of_all_cones() {
    // A fifth of the pixels limits the others. Images of one row and one column are included.
    for (rows, cols) in [(17, 23), (1, 12), (9, 1)] {
        let pixel = |(row, col)| if (row + 2 * col) % 5 == 0 { 20.0 * uneven(row, col) } else { f32::INFINITY };
        let image = Array2::from_shape_fn((rows, cols), pixel);
        let limited = limit_rise(&image, 0.75);
        for ((row, col), &value) in limited.indexed_iter() {
            let cone = |((at_row, at_col), &z): ((usize, usize), &f32)| {
                let down = row.abs_diff(at_row);
                let along = col.abs_diff(at_col);
                let corners = down.min(along) as f32;
                let edges = down.abs_diff(along) as f32;
                z + 0.75 * (corners * std::f32::consts::SQRT_2 + edges)
            };
            let least = image.indexed_iter().map(cone).fold(f32::INFINITY, f32::min);
            assert!((value - least).abs() < 1e-4, "({row}, {col}): {value} instead of {least}");
        }
    }
}

#[test]
fn gentle_slope_is_unchanged_and_infinite_pixels_are_limited() {
    let slope = Array2::from_shape_fn((8, 11), |(row, col)| 0.125 * row as f32 - 0.5 * col as f32);
    assert_eq!(limit_rise(&slope, 0.5), slope);
    let nothing = Array2::from_elem((3, 4), f32::INFINITY);
    assert_eq!(limit_rise(&nothing, 0.5), nothing);
    assert_eq!(limit_rise(&Array2::zeros((0, 4)), 0.5).dim(), (0, 4));
    assert_eq!(limit_rise(&Array2::zeros((4, 0)), 0.5).dim(), (4, 0));
}
