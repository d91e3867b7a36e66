//! Extrema, watershed and geodesic distances are compared with their definitions, on small images of few levels.

use morphology::{
    Connectivity, connected_components, geodesic_distances, geodesic_elongations, h_maxima, regional_maxima,
    regional_minima, watershed,
};
use ndarray::{Array2, array};

const BOTH: [Connectivity; 2] = [Connectivity::Four, Connectivity::Eight];

fn noise(shape: (usize, usize), seed: usize, levels: u8) -> Array2<u8> {
    Array2::from_shape_fn(shape, |(row, col)| {
        let mixed = (row * 7919 + col * 104_729 + seed * 1_299_709 + 17).wrapping_mul(2_654_435_761);
        (mixed >> 11) as u8 % levels
    })
}

fn neighbors(shape: (usize, usize), at: (usize, usize), connectivity: Connectivity) -> Vec<(usize, usize)> {
    let all = ndarray::indices(shape).into_iter().filter(|&other| {
        let rows = at.0.abs_diff(other.0);
        let cols = at.1.abs_diff(other.1);
        if connectivity == Connectivity::Four { rows + cols == 1 } else { rows.max(cols) == 1 }
    });
    all.collect()
}

/// Pixels connected with `at` by a path that is never below `level`.
fn reach(image: &Array2<u8>, at: (usize, usize), level: u8, connectivity: Connectivity) -> Vec<(usize, usize)> {
    let mut found = vec![at];
    let mut next = 0;
    while next < found.len() {
        for other in neighbors(image.dim(), found[next], connectivity) {
            if image[other] >= level && !found.contains(&other) {
                found.push(other);
            }
        }
        next += 1;
    }
    found
}

#[test]
fn regional_maxima_are_plateaus_without_higher_neighbors() {
    for seed in 0..25 {
        let image = noise((1 + seed % 9, 1 + seed * 3 % 11), seed, 5);
        for connectivity in BOTH {
            let truth = Array2::from_shape_fn(image.dim(), |at| {
                reach(&image, at, image[at], connectivity).iter().all(|&other| image[other] <= image[at])
            });
            assert_eq!(regional_maxima(&image, connectivity), truth);
            assert_eq!(regional_maxima(&image.mapv(|v| f32::from(v) - 2.5), connectivity), truth);
            assert_eq!(regional_minima(&image.mapv(|v| 9 - v), connectivity), truth);
        }
    }
    let flat = Array2::from_elem((3, 4), 0_u8);
    assert_eq!(regional_maxima(&flat, Connectivity::Four), Array2::from_elem((3, 4), true));
}

#[test]
fn h_maxima_stand_out_by_the_height() {
    for seed in 0..25 {
        let image = noise((2 + seed % 7, 2 + seed * 3 % 9), seed, 9).mapv(|v| v + 20);
        for connectivity in BOTH {
            for height in [1, 2, 4] {
                // A pixel stands out by `height` if no path above its level - height leads to a higher pixel.
                let truth = Array2::from_shape_fn(image.dim(), |at| {
                    let way = reach(&image, at, image[at] - height + 1, connectivity);
                    way.iter().all(|&other| image[other] <= image[at])
                });
                assert_eq!(h_maxima(&image, height, connectivity), truth, "{image:?} {height}");
            }
        }
    }
}

#[test]
fn basins_grow_at_the_lowest_and_oldest_adjacent_pixel() {
    for seed in 0..40 {
        let image = noise((2 + seed % 8, 2 + seed * 3 % 9), seed, 6);
        let mask = noise(image.dim(), seed + 100, 5).mapv(|v| v > 0);
        let markers = noise(image.dim(), seed + 200, 12).mapv(|v| if v < 3 { u32::from(v) } else { 0 });
        for connectivity in BOTH {
            let mut truth = Array2::<u32>::zeros(image.dim());
            let mut open: Vec<(usize, usize)> = Vec::new();
            for (at, &label) in markers.indexed_iter().filter(|&(at, &label)| label > 0 && mask[at]) {
                truth[at] = label;
                open.push(at);
            }
            // The oldest of the lowest: `open` is sorted by age.
            while let Some(idx) = (0..open.len()).min_by_key(|&idx| image[open[idx]]) {
                let at = open.remove(idx);
                for other in neighbors(image.dim(), at, connectivity) {
                    if mask[other] && truth[other] == 0 {
                        truth[other] = truth[at];
                        open.push(other);
                    }
                }
            }
            assert_eq!(watershed(&image, &markers, &mask, connectivity), truth);
            let floats = image.mapv(|v| f32::from(v) - 3.0);
            let words = image.mapv(u16::from);
            assert_eq!(watershed(&floats, &markers, &mask, connectivity), truth);
            assert_eq!(watershed(&words, &markers, &mask, connectivity), truth);
        }
    }
}

#[test]
fn two_basins_are_separated_at_the_ridge() {
    let image = array![[3_u8, 1, 2, 5, 2, 0, 3]];
    let markers = array![[0_u32, 7, 0, 0, 0, 4, 0]];
    let mask = Array2::from_elem((1, 7), true);
    let basins = watershed(&image, &markers, &mask, Connectivity::Four);
    assert_eq!(basins, array![[7, 7, 7, 4, 4, 4, 4]]);
}

#[test]
fn geodesic_paths_go_around_obstacles() {
    // A wall with a gap at the far end.
    let mask = array![
        [true, true, true, true],
        [false, false, false, true],
        [true, true, true, true],
        [false, false, true, false],
    ];
    let distances = geodesic_distances(&mask, &[(0, 0)]);
    let corner = std::f64::consts::SQRT_2;
    assert_eq!(distances[[1, 3]], 2.0 + corner);
    assert_eq!(distances[[2, 2]], 2.0 + 2.0 * corner);
    assert_eq!(distances[[2, 0]], 4.0 + 2.0 * corner);
    assert_eq!(distances[[1, 0]], f64::INFINITY);
    assert_eq!(geodesic_distances(&mask, &[(1, 1)])[[0, 0]], f64::INFINITY);
}

#[test]
fn bent_bar_is_elongated() {
    let mut mask = Array2::from_elem((60, 60), false);
    mask.slice_mut(ndarray::s![2, 3..43]).fill(true); // a bar of 40 x 1
    for (at, inside) in mask.indexed_iter_mut() {
        let row = at.0 as f64 - 30.0;
        let col = at.1 as f64 - 30.0;
        *inside |= row.hypot(col) < 9.5; // a disc
    }
    mask.slice_mut(ndarray::s![45..58, 5]).fill(true); // an L of 13 and 21
    mask.slice_mut(ndarray::s![57, 5..25]).fill(true);
    let labels = connected_components(&mask, Connectivity::Eight);
    let elongations = geodesic_elongations(&labels);
    let quarter = std::f64::consts::FRAC_PI_4;
    assert!((elongations[0] - quarter * 40.0).abs() < 1e-9, "{elongations:?}");
    assert!((0.9..1.3).contains(&elongations[1]), "{elongations:?}");
    // 12 + 19 - 1 straight steps and one across the corner, over 32 pixels.
    let length = 12.0 + 19.0 - 2.0 + std::f64::consts::SQRT_2 + 1.0;
    assert!((elongations[2] - quarter * length * length / 32.0).abs() < 1e-9, "{elongations:?}");
    assert_eq!(elongations.len(), 3);
}
