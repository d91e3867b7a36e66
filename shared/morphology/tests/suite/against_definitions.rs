//! Every operator is compared with a direct implementation of its definition, on seeded random images.

use morphology::{
    Connectivity, Labels, Level, area_closing, area_opening, closing, connected_components, dilate, erode, fill_basins,
    opening, quasi_flat_zones, quasi_flat_zones_over_gaps, reconstruct_by_dilation, reconstruct_by_erosion,
};
use ndarray::{Array2, array};
use random::Random;

const BOTH: [Connectivity; 2] = [Connectivity::Four, Connectivity::Eight];

/// Random images.
struct Images(Random);

impl Images {
    fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }
    fn below(&mut self, n: u64) -> u64 {
        self.0.index(n as usize) as u64
    }
    fn image(&mut self, levels: u64) -> Array2<u8> {
        let rows = 1 + self.below(14) as usize;
        let cols = 1 + self.below(14) as usize;
        Array2::from_shape_fn((rows, cols), |_| self.below(levels) as u8)
    }
    fn mask(&mut self, like: &Array2<u8>) -> Array2<bool> {
        like.mapv(|_| self.below(3) > 0)
    }
}

fn touch(a: (usize, usize), b: (usize, usize), connectivity: Connectivity) -> bool {
    let rows = a.0.abs_diff(b.0);
    let cols = a.1.abs_diff(b.1);
    match connectivity {
        Connectivity::Four => rows + cols == 1,
        Connectivity::Eight => rows.max(cols) == 1,
    }
}

/// Zones under any relation between pixels, by growing one at a time.
fn zones_of(
    shape: (usize, usize),
    inside: impl Fn((usize, usize)) -> bool,
    joined: impl Fn((usize, usize), (usize, usize)) -> bool,
) -> Labels {
    let pixels: Vec<(usize, usize)> = ndarray::indices(shape).into_iter().filter(|&pixel| inside(pixel)).collect();
    let mut labels = Labels { image: Array2::zeros(shape), areas: Vec::new() };
    for &seed in &pixels {
        if labels.image[seed] != 0 {
            continue;
        }
        let label = labels.areas.len() as u32 + 1;
        labels.image[seed] = label;
        let mut members = vec![seed];
        let mut next = 0;
        while next < members.len() {
            for &other in &pixels {
                if labels.image[other] == 0 && joined(members[next], other) {
                    labels.image[other] = label;
                    members.push(other);
                }
            }
            next += 1;
        }
        labels.areas.push(members.len());
    }
    labels
}

fn window<T: Level>(image: &Array2<T>, radius: usize, neutral: T, pick: fn(T, T) -> T) -> Array2<T> {
    Array2::from_shape_fn(image.dim(), |(row, col)| {
        let mut value = neutral;
        for ((r, c), &other) in image.indexed_iter() {
            if r.abs_diff(row) <= radius && c.abs_diff(col) <= radius {
                value = pick(value, other);
            }
        }
        value
    })
}

#[test]
fn dilation_and_erosion_by_squares_are_window_extrema() {
    let mut random = Images::new(1);
    for _ in 0..150 {
        let image = random.image(40);
        let heights = image.mapv(|v| f32::from(v) - 20.5);
        for radius in [0, 1, 2, 3, 7, 40] {
            assert_eq!(dilate(&image, radius), window(&image, radius, u8::MIN, u8::sup), "radius {radius}");
            assert_eq!(erode(&image, radius), window(&image, radius, u8::MAX, u8::inf), "radius {radius}");
            assert_eq!(dilate(&heights, radius), window(&heights, radius, f32::NEG_INFINITY, f32::max));
        }
    }
}

#[test]
fn memory_order_does_not_change_results() {
    let mut random = Images::new(2);
    let by_column = Array2::from_shape_fn((9, 13), |_| random.below(9) as u8).reversed_axes();
    let by_row = by_column.as_standard_layout().into_owned();
    assert_ne!(by_column.strides(), by_row.strides());
    assert_eq!(dilate(&by_column, 2), dilate(&by_row, 2));
    assert_eq!(area_opening(&by_column, 4, Connectivity::Four), area_opening(&by_row, 4, Connectivity::Four));
    let mask_by_column = by_column.mapv(|v| v > 4);
    let mask_by_row = by_row.mapv(|v| v > 4);
    let labels = connected_components(&mask_by_column, Connectivity::Eight);
    assert_eq!(labels, connected_components(&mask_by_row, Connectivity::Eight));
}

#[test]
fn openings_and_closings_are_idempotent_and_bounded_by_the_image() {
    let mut random = Images::new(3);
    for _ in 0..100 {
        let image = random.image(30);
        for radius in [1, 2, 5] {
            let opened = opening(&image, radius);
            let closed = closing(&image, radius);
            assert!(opened.iter().zip(&image).all(|(o, i)| o <= i) && closed.iter().zip(&image).all(|(c, i)| c >= i));
            assert_eq!(opening(&opened, radius), opened);
            assert_eq!(closing(&closed, radius), closed);
        }
    }
}

#[test]
fn opening_keeps_a_slope_and_removes_a_car() {
    let slope = Array2::from_shape_fn((40, 40), |(row, _)| row as f32 * 0.25);
    let mut street = slope.clone();
    street.slice_mut(ndarray::s![15..20, 12..18]).mapv_inplace(|z| z + 1.5);
    // Windows at the highest rows are clipped, so the opening is lower there.
    let inner = ndarray::s![..36, ..];
    assert_eq!(opening(&street, 4).slice(inner), slope.slice(inner));
    assert_eq!(opening(&street, 1)[[17, 15]], slope[[17, 15]] + 1.5);
}

#[test]
fn components_and_zones_are_the_transitive_closure_of_their_relation() {
    let mut random = Images::new(4);
    for _ in 0..120 {
        let image = random.image(6);
        let heights = image.mapv(|v| f32::from(v) * 0.5);
        let mask = random.mask(&image);
        for connectivity in BOTH {
            let inside = |pixel: (usize, usize)| mask[pixel];
            let truth = zones_of(image.dim(), inside, |a, b| touch(a, b, connectivity));
            assert_eq!(connected_components(&mask, connectivity), truth);
            for lambda in [0.0, 0.5, 1.2] {
                let joined = |a, b| touch(a, b, connectivity) && (heights[a] - heights[b]).abs() <= lambda;
                let truth = zones_of(image.dim(), inside, joined);
                assert_eq!(quasi_flat_zones(&heights, &mask, lambda, connectivity), truth);
            }
        }
    }
}

/// The label image is written in batches of rows.
#[test]
fn components_of_a_tall_image_are_those_of_a_flood_fill() {
    let mut random = Images::new(6);
    let mask = Array2::from_shape_fn((70_001, 3), |_| random.below(3) > 0);
    for connectivity in BOTH {
        let mut labels = Array2::<u32>::zeros(mask.dim());
        let mut n = 0;
        for (start, _) in mask.indexed_iter().filter(|(_, inside)| **inside) {
            if labels[start] > 0 {
                continue;
            }
            n += 1;
            labels[start] = n;
            let mut stack = vec![start];
            while let Some(pixel) = stack.pop() {
                for at in (pixel.0.saturating_sub(1)..=pixel.0 + 1).flat_map(|row| (0..3).map(move |col| (row, col))) {
                    if mask.get(at) == Some(&true) && labels[at] == 0 && touch(pixel, at, connectivity) {
                        labels[at] = n;
                        stack.push(at);
                    }
                }
            }
        }
        let components = connected_components(&mask, connectivity);
        assert_eq!(components.image, labels);
        assert_eq!(components.areas.iter().sum::<usize>(), mask.iter().filter(|inside| **inside).count());
    }
}

#[test]
fn zones_over_gaps_join_the_nearest_valid_pixels_of_a_line() {
    let mut random = Images::new(5);
    for _ in 0..120 {
        let image = random.image(6);
        let heights = image.mapv(|v| f32::from(v) * 0.5);
        let mask = random.mask(&image);
        let steps = [0.5_f32, 0.6, 1.1, 1.6];
        let joined = |a: (usize, usize), b: (usize, usize)| {
            let gap = if a.0 == b.0 { a.1.abs_diff(b.1) } else { a.0.abs_diff(b.0) };
            let in_line = (a.0 == b.0) != (a.1 == b.1);
            let clear = in_line
                && (1..gap).all(|i| {
                    let row = a.0.min(b.0);
                    let col = a.1.min(b.1);
                    !mask[if a.0 == b.0 { [row, col + i] } else { [row + i, col] }]
                });
            clear && gap <= steps.len() && (heights[a] - heights[b]).abs() <= steps[gap - 1]
        };
        let truth = zones_of(image.dim(), |pixel| mask[pixel], joined);
        assert_eq!(quasi_flat_zones_over_gaps(&heights, &mask, &steps), truth);
        assert_eq!(
            quasi_flat_zones_over_gaps(&heights, &mask, &steps[..1]),
            quasi_flat_zones(&heights, &mask, steps[0], Connectivity::Four)
        );
    }
}

#[test]
fn labels_increase_in_raster_order() {
    // The first pixel of label 1 precedes the first pixel of label 2, although its component is connected only at the
    // bottom.
    let mask = array![[true, false, true], [true, false, false], [true, true, true]];
    let labels = connected_components(&mask, Connectivity::Four);
    assert_eq!(labels.image, array![[1, 0, 2], [1, 0, 0], [1, 1, 1]]);
    assert_eq!((labels.n(), labels.area(1), labels.area(2), labels.area(0), labels.area(3)), (2, 5, 1, 0, 0));
}

#[test]
fn area_opening_keeps_the_highest_level_with_sufficient_area() {
    let mut random = Images::new(6);
    for _ in 0..60 {
        let image = random.image(7);
        for connectivity in BOTH {
            for area in [1, 2, 5, 12] {
                let mut truth = image.mapv(|_| *image.iter().min().expect("not empty"));
                for level in 0..7 {
                    let above = image.mapv(|v| v >= level);
                    let zones = zones_of(image.dim(), |pixel| above[pixel], |a, b| touch(a, b, connectivity));
                    for (pixel, value) in truth.indexed_iter_mut() {
                        if zones.area(zones.image[pixel]) >= area {
                            *value = (*value).max(level);
                        }
                    }
                }
                assert_eq!(area_opening(&image, area, connectivity), truth);
                let upside_down = image.mapv(|v| 6 - v);
                assert_eq!(area_closing(&upside_down, area, connectivity), truth.mapv(|v| 6 - v));
            }
        }
    }
}

#[test]
fn binary_area_closing_fills_only_the_small_hole() {
    let mut mask = Array2::from_elem((12, 20), true);
    mask.slice_mut(ndarray::s![2..5, 2..5]).fill(false);
    mask.slice_mut(ndarray::s![2..7, 10..12]).fill(false);
    let mut truth = mask.clone();
    truth.slice_mut(ndarray::s![2..5, 2..5]).fill(true);
    assert_eq!(area_closing(&mask, 10, Connectivity::Four), truth);
}

#[test]
fn reconstruction_is_the_limit_of_geodesic_dilations() {
    let mut random = Images::new(7);
    for _ in 0..100 {
        let mask = random.image(9);
        let marker = mask.mapv(|_| random.below(9) as u8);
        for connectivity in BOTH {
            let mut truth = ndarray::Zip::from(&marker).and(&mask).map_collect(|&a, &b| a.min(b));
            loop {
                let grown = Array2::from_shape_fn(mask.dim(), |at| {
                    let neighbors =
                        truth.indexed_iter().filter(|&(other, _)| other == at || touch(at, other, connectivity));
                    neighbors.map(|(_, &v)| v).max().expect("itself").min(mask[at])
                });
                if grown == truth {
                    break;
                }
                truth = grown;
            }
            assert_eq!(reconstruct_by_dilation(&marker, &mask, connectivity), truth);
            let low_marker = marker.mapv(|v| 8 - v);
            let low_mask = mask.mapv(|v| 8 - v);
            let dual = reconstruct_by_erosion(&low_marker, &low_mask, connectivity);
            assert_eq!(dual, truth.mapv(|v| 8 - v));
        }
    }
}

#[test]
fn basin_is_filled_to_its_lowest_pass() {
    let ground = array![
        [9.0_f32, 9.0, 9.0, 9.0, 9.0],
        [9.0, 1.0, 2.0, 9.0, 9.0],
        [9.0, 1.0, 9.0, 0.0, 4.0],
        [9.0, 9.0, 9.0, 9.0, 9.0],
    ];
    let mut four = ground.clone();
    four.slice_mut(ndarray::s![1..3, 1..3]).mapv_inplace(|z: f32| z.max(9.0));
    four[[2, 3]] = 4.0;
    assert_eq!(fill_basins(&ground, Connectivity::Four), four);
    // With corners the left basin drains through (1, 2) into the right one and out of the image at (2, 4).
    let mut eight = ground.clone();
    for pixel in [[1, 1], [1, 2], [2, 1], [2, 3]] {
        eight[pixel] = 4.0;
    }
    assert_eq!(fill_basins(&ground, Connectivity::Eight), eight);
}

#[test]
fn empty_and_single_pixel_images_are_processed() {
    for shape in [(0, 0), (0, 5), (5, 0), (1, 1)] {
        let image = Array2::<u8>::from_elem(shape, 3);
        let mask = Array2::from_elem(shape, true);
        assert_eq!(opening(&image, 2), image);
        assert_eq!(area_opening(&image, 10, Connectivity::Eight), image);
        assert_eq!(fill_basins(&image, Connectivity::Four), image);
        assert_eq!(connected_components(&mask, Connectivity::Eight).n(), image.len());
        let heights = image.mapv(f32::from);
        assert_eq!(quasi_flat_zones_over_gaps(&heights, &mask, &[]).n(), image.len());
    }
}
