//! Roughness of the ground: low vegetation that hides the ground is as low as the ground, but rougher.

use nalgebra::{Matrix3, Vector3};
use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;

/// Half side lengths of the windows, cells. The larger ones are used where points are too sparse for the smaller ones.
const REACHES: [usize; 3] = [2, 4, 8];

/// Least number of cells with a height in a window.
const MIN_CELLS: f32 = 8.0;

/// Least determinant of the covariance of these cells, cells^4: 8 cells in two neighboring rows have 1.3, cells in a
/// line 0.
const MIN_SPREAD: f32 = 0.5;

/// Half the side of the window of the vote, cells.
const VOTE_REACH: usize = 5;

/// Share of the ground that is smooth: its deviations are the noise of the sensor.
const SMOOTH_SHARE: f64 = 0.25;

/// Ground is at most this many times as rough as smooth ground. Chosen on five places of a Livox Avia, whose smooth ground deviates by 0.7 to
/// 3 cm: 0, 2, 3, 5 give 93.0, 94.8, 95.3, 95.6 % correct points there, and 97.0, 97.0, 96.9, 96.8 % on sweeps of an HDL-64E, whose smooth
/// ground deviates by 0.4 cm.
const NOISE_FACTOR: f32 = 3.0;

/// Largest noise, m: where no ground is smooth, vegetation stays rough. Of five places of a Livox Avia, one has more (94.9 instead of
/// 95.3 % of all five).
const MAX_NOISE_M: f32 = 0.02;

/// Whether the heights around a cell scatter around their plane by more than `limit_m` (standard deviation, m) and the noise of the sensor
/// together. NaN is a cell without a height; such cells, and cells with too few heights around them, are not rough.
///
/// A larger window includes more of the curvature: its limit is larger by its number (1, 2, 3). The majority of the
/// cells within 1.1 m decides, so that a curb, which is narrow, is not rough.
pub(crate) fn rough_cells(heights_m: &Array2<f32>, limit_m: f32) -> Array2<bool> {
    let deviations_m = for_each_cell(heights_m.dim(), |cell| {
        if heights_m[cell].is_nan() {
            return None;
        }
        let mut windows = REACHES.into_iter().zip(1_u8..);
        windows.find_map(|(reach, number)| {
            let deviation_m = deviation_from_plane(&window(heights_m, cell, reach), heights_m[cell])?;
            Some(deviation_m / f32::from(number))
        })
    });
    let limit_m = limit_m.hypot(NOISE_FACTOR * noise_m(&deviations_m));
    let scatters = deviations_m.map(|deviation_m| deviation_m.map(|deviation_m| deviation_m > limit_m));
    for_each_cell(heights_m.dim(), |cell| {
        let votes = |of: Option<bool>| window(&scatters, cell, VOTE_REACH).iter().filter(|vote| **vote == of).count();
        scatters[cell].is_some() && votes(Some(true)) > votes(Some(false))
    })
}

/// The deviation of smooth ground, 0 to [`MAX_NOISE_M`]; 0 without ground.
fn noise_m(deviations_m: &Array2<Option<f32>>) -> f32 {
    let mut known: Vec<f32> = deviations_m.iter().flatten().copied().collect();
    let at = (known.len() as f64 * SMOOTH_SHARE) as usize;
    if known.is_empty() { 0.0 } else { known.select_nth_unstable_by(at, f32::total_cmp).1.min(MAX_NOISE_M) }
}

/// An image of the values of its cells, computed by all threads.
fn for_each_cell<T: Send>((rows, cols): (usize, usize), value: impl Fn((usize, usize)) -> T + Sync) -> Array2<T> {
    let of_row = |row: usize| (0..cols).map(|col| value((row, col))).collect::<Vec<T>>();
    let values = (0..rows).into_par_iter().flat_map_iter(of_row).collect();
    Array2::from_shape_vec((rows, cols), values).expect("a value for each cell")
}

/// Standard deviation from the least-squares plane. Heights are relative to `height_m`, to keep their precision. `None`
/// if there are too few heights, or all are in one line.
fn deviation_from_plane(window: &ArrayView2<'_, f32>, height_m: f32) -> Option<f32> {
    let mut n = 0.0;
    let mut normal = Matrix3::<f32>::zeros();
    let mut right = Vector3::zeros();
    let mut square = 0.0;
    for ((row, col), z) in window.indexed_iter().filter(|(_, z)| !z.is_nan()) {
        let at = Vector3::new(row as f32, col as f32, 1.0);
        let z = z - height_m;
        n += 1.0;
        normal += at * at.transpose();
        right += at * z;
        square += z * z;
    }
    // The determinant of the covariance of rows and columns.
    let spread = normal.determinant() / (n * n * n);
    let plane = (n >= MIN_CELLS && spread > MIN_SPREAD).then(|| normal.cholesky())??.solve(&right);
    Some(((square - plane.dot(&right)) / (n - 3.0)).max(0.0).sqrt())
}

/// The cells up to `reach` rows and columns away.
fn window<T>(image: &Array2<T>, (row, col): (usize, usize), reach: usize) -> ArrayView2<'_, T> {
    let (rows, cols) = image.dim();
    let around = |at: usize, n: usize| at.saturating_sub(reach)..(at + reach + 1).min(n);
    image.slice(s![around(row, rows), around(col, cols)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    /// A slope of 15 % with a curb at column 20, scattered by `sigma_m`. One of `sparse` cells has a height.
    fn slope(sigma_m: f32, sparse: usize) -> Array2<f32> {
        let mut random = Random::new(1);
        Array2::from_shape_fn((40, 40), |(row, col)| {
            let height_m = 100.0 + 0.03 * row as f32 + if col < 20 { 0.0 } else { 0.12 } + sigma_m * random.gauss();
            if (row * 40 + col).is_multiple_of(sparse) { height_m } else { f32::NAN }
        })
    }

    #[test]
    fn slope_with_curb_is_smooth_and_scattered_heights_are_rough() {
        for sparse in [1, 3, 7] {
            let heights_m = slope(0.01, sparse);
            assert!(!rough_cells(&heights_m, 0.04).iter().any(|rough| *rough), "one of {sparse}");
        }
        for sparse in [1, 3] {
            let heights_m = slope(0.15, sparse);
            let n_heights = heights_m.iter().filter(|height| !height.is_nan()).count();
            let n_rough = rough_cells(&heights_m, 0.04).iter().filter(|rough| **rough).count();
            assert_eq!(n_rough, n_heights, "one of {sparse}");
        }
    }

    #[test]
    fn noise_of_the_sensor_is_not_rough_beside_rougher_vegetation() {
        let mut heights_m = slope(0.025, 1);
        let grass = slope(0.2, 1);
        heights_m.slice_mut(s![30.., ..]).assign(&grass.slice(s![30.., ..]));
        let rough = rough_cells(&heights_m, 0.02);
        assert!(
            !rough.slice(s![..24, ..]).iter().any(|rough| *rough)
                && rough.slice(s![36.., ..]).iter().all(|rough| *rough)
        );
    }

    #[test]
    fn cells_without_height_or_neighbors_are_not_rough() {
        let mut alone = Array2::from_elem((40, 40), f32::NAN);
        alone[(20, 20)] = 1.0;
        // A single line of heights has no plane.
        alone.slice_mut(s![5, ..]).iter_mut().zip(0_u8..).for_each(|(height, col)| *height = f32::from(col % 2));
        assert!(!rough_cells(&alone, 0.04).iter().any(|rough| *rough));
    }
}
