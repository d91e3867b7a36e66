//! Dilation and erosion by elements of every shape are compared with their definition.

use morphology::{Element, Level, closing, dilate, erode, opening};
use ndarray::{Array2, array};

/// Reproducible pseudo-random values.
fn noise(shape: (usize, usize), seed: usize) -> Array2<u16> {
    Array2::from_shape_fn(shape, |(row, col)| {
        let mixed = (row * 7919 + col * 104_729 + seed * 1_299_709).wrapping_mul(2_654_435_761);
        (mixed >> 9) as u16 % 977
    })
}

fn extremum<T: Level>(
    image: &Array2<T>,
    offsets: &[(isize, isize)],
    sign: isize,
    neutral: T,
    pick: fn(T, T) -> T,
) -> Array2<T> {
    Array2::from_shape_fn(image.dim(), |(row, col)| {
        let at = |&(r, c): &(isize, isize)| {
            image.get([row.checked_add_signed(sign * r)?, col.checked_add_signed(sign * c)?]).copied()
        };
        offsets.iter().filter_map(at).fold(neutral, pick)
    })
}

fn check(offsets: &[(isize, isize)], element: &Element) {
    for (seed, shape) in [(1, 1), (1, 9), (9, 1), (13, 17), (40, 70)].into_iter().enumerate() {
        let image = noise(shape, seed);
        let floats = image.mapv(|v| f32::from(v) * 0.25 - 100.0);
        let bools = image.mapv(|v| v > 600);
        assert_eq!(dilate(&image, element), extremum(&image, offsets, -1, 0, u16::sup), "{element:?}");
        assert_eq!(erode(&image, element), extremum(&image, offsets, 1, u16::MAX, u16::inf), "{element:?}");
        assert_eq!(dilate(&floats, element), extremum(&floats, offsets, -1, f32::NEG_INFINITY, f32::max));
        assert_eq!(erode(&floats, element), extremum(&floats, offsets, 1, f32::INFINITY, f32::min));
        assert_eq!(dilate(&bools, element), extremum(&bools, offsets, -1, false, bool::sup));
        let opened = opening(&image, element);
        let closed = closing(&image, element);
        assert!(opened.iter().zip(&image).all(|(o, i)| o <= i) && closed.iter().zip(&image).all(|(c, i)| c >= i));
        assert_eq!(opening(&opened, element), opened);
        assert_eq!(closing(&closed, element), closed);
    }
}

#[test]
fn rectangles_of_all_sizes() {
    for (row_radius, col_radius) in [(0, 0), (0, 3), (5, 0), (1, 2), (2, 1), (7, 33), (60, 90)] {
        let r = row_radius as isize;
        let c = col_radius as isize;
        let offsets: Vec<_> = (-r..=r).flat_map(|row| (-c..=c).map(move |col| (row, col))).collect();
        check(&offsets, &Element::rectangle(row_radius, col_radius));
        check(&offsets, &Element::from_offsets(offsets.iter().copied()));
    }
}

/// Results are written in batches of rows, whose number depends on the type.
#[test]
fn batches_of_rows_have_no_seams() {
    let box_of = |r: isize, c: isize| (-r..=r).flat_map(|row| (-c..=c).map(move |col| (row, col))).collect();
    let line_of = |rows: isize, cols: isize| (-4..=4).map(|t| (t * rows, t * cols)).collect();
    let elements: [Vec<(isize, isize)>; 8] = [
        box_of(1, 1),
        box_of(2, 2),
        box_of(3, 4),
        box_of(0, 20),
        box_of(1, 200),
        line_of(1, 1),
        line_of(0, 300),
        line_of(1, -2),
    ];
    for (shape, max_offsets) in [((6, 4500), usize::MAX), ((90_001, 4), 100)] {
        let image = noise(shape, 7);
        let floats = image.mapv(|v| f32::from(v) * 0.25 - 100.0);
        let bools = image.mapv(|v| v > 960);
        for offsets in elements.iter().filter(|offsets| offsets.len() <= max_offsets) {
            let (rows, cols) = offsets.iter().fold((0, 0), |(r, c), &(row, col)| (r.max(row), c.max(col)));
            let is_box = offsets.len() as isize == (2 * rows + 1) * (2 * cols + 1);
            let element = if is_box {
                Element::rectangle(rows as usize, cols as usize)
            } else {
                Element::from_offsets(offsets.iter().copied())
            };
            assert_eq!(dilate(&image, &element), extremum(&image, offsets, -1, 0, u16::sup), "{element:?}");
            assert_eq!(erode(&floats, &element), extremum(&floats, offsets, 1, f32::INFINITY, f32::min), "{element:?}");
            assert_eq!(dilate(&bools, &element), extremum(&bools, offsets, -1, false, bool::sup), "{element:?}");
        }
    }
}

#[test]
fn discs_contain_all_offsets_up_to_their_radius() {
    for radius in [0, 1, 2, 5, 12] {
        let all = (-radius..=radius).flat_map(|row| (-radius..=radius).map(move |col| (row, col)));
        let offsets: Vec<_> = all.filter(|(row, col)| row * row + col * col <= radius * radius).collect();
        check(&offsets, &Element::disc(radius as usize));
    }
}

#[test]
fn lines_have_one_pixel_per_step_and_are_symmetric() {
    let steep = [(-3, -1), (-2, -1), (-1, 0), (0, 0), (1, 0), (2, 1), (3, 1)];
    check(&steep, &Element::line(3, 1));
    check(&[(0, 0)], &Element::line(0, 0));
    // Lines that decompose into two shifted shorter lines.
    let long: Vec<_> = (-10..=10_isize).map(|row| (row, (f64::from(row as i32) * 0.4).round() as isize)).collect();
    check(&long, &Element::line(10, 4));
    let wide: Vec<_> = long.iter().map(|&(row, col)| (col, row)).collect();
    check(&wide, &Element::line(4, 10));
    let diagonal: Vec<_> = (-4..=4).map(|i| (i, -i)).collect();
    check(&diagonal, &Element::line(4, -4));
    for (rows, cols) in [(7, 3), (-2, 9), (5, 5), (0, 6)] {
        let line = Element::line(rows, cols);
        assert_eq!(line.reflected(), line);
    }
}

#[test]
fn element_off_its_origin_shifts_the_image() {
    // Dilation by one offset is a shift by it; erosion shifts back.
    let image = array![[0_u8, 0, 0], [5, 0, 0], [0, 0, 0]];
    let right = Element::from_offsets([(-1, 2)]);
    assert_eq!(dilate(&image, &right), array![[0, 0, 5], [0, 0, 0], [0, 0, 0]]);
    check(&[(-1, 2)], &right);
    check(&[(0, 4), (0, 1), (3, -2), (0, 4)], &Element::from_offsets([(0, 4), (0, 1), (3, -2), (0, 4)]));
    check(&[(0, 500)], &Element::from_offsets([(0, 500)]));
    check(&[], &Element::from_offsets([]));
}
