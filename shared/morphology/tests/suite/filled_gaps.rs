//! Interpolation of missing heights.

use morphology::fill_gaps;
use ndarray::Array2;

#[test]
fn hole_in_a_slope_is_filled_with_the_slope() {
    let slope = |(row, col): (usize, usize)| 3.0 + 0.25 * row as f32 - 0.125 * col as f32;
    let truth = Array2::from_shape_fn((30, 24), slope);
    let known = Array2::from_shape_fn((30, 24), |(row, col)| !((4..19).contains(&row) && (6..20).contains(&col)));
    let holed = Array2::from_shape_fn((30, 24), |at| if known[at] { truth[at] } else { 99.0 });
    let filled = fill_gaps(&holed, &known).expect("there is ground");
    for (at, &z) in filled.indexed_iter() {
        assert!((z - truth[at]).abs() < 1e-5, "{at:?}: {z} instead of {}", truth[at]);
    }
}

#[test]
fn measured_dip_is_kept() {
    let mut dip = Array2::from_elem((9, 9), 1.0_f32);
    dip[[4, 4]] = -2.0;
    let known = Array2::from_elem((9, 9), true);
    assert_eq!(fill_gaps(&dip, &known), Some(dip));
}

#[test]
fn pixels_without_crossing_line_get_the_nearest_height() {
    let mut heights = Array2::from_elem((6, 7), 50.0_f32);
    let mut known = Array2::from_elem((6, 7), false);
    for (at, z) in [([0, 0], 1.0), ([5, 6], 2.0)] {
        heights[at] = z;
        known[at] = true;
    }
    let filled = fill_gaps(&heights, &known).expect("two pixels are known");
    for ((row, col), &z) in filled.indexed_iter() {
        let first = row + col;
        let second = 5 - row + 6 - col;
        if first != second {
            assert_eq!(z, if first < second { 1.0 } else { 2.0 }, "({row}, {col})");
        }
    }
}

#[test]
fn image_without_valid_pixels_has_no_result() {
    let heights = Array2::from_elem((3, 3), 0.0_f32);
    assert_eq!(fill_gaps(&heights, &heights.mapv(|_| false)), None);
    assert_eq!(fill_gaps(&Array2::zeros((0, 4)), &Array2::from_elem((0, 4), true)), None);
}
