//! Parts of a sweep, as another sensor would measure it: fewer rings, or a sector.

use super::super::labeled_image::LabeledImage;
use random::Random;
use segmentation::spherical::{PolarImage, PolarPixel};
use training::UNKNOWN;

/// Rows of a full revolution. With more rows, a sector of as many pixels is used, so that all training images cost the same.
const ROWS: usize = 32;
/// Columns of a sector are a multiple of this, so that networks of any fold and depth fit.
const COLUMN_STEP: usize = 128;

/// Chooses rows and a sector at random.
pub fn random_view(of: LabeledImage, random: &mut Random) -> LabeledImage {
    let rows = random_rows(of.image.rows, random);
    let columns = if rows.len() <= ROWS { of.image.columns } else { sector(of.image.columns, rows.len()) };
    if rows.len() == of.image.rows && columns == of.image.columns {
        return of;
    }
    let first = if columns == of.image.columns { 0 } else { random.index(of.image.columns) };
    view(&of, &rows, first, columns)
}

/// All rows, every n-th, or some. A sensor with few rings keeps at least half of them.
fn random_rows(rows: usize, random: &mut Random) -> Vec<usize> {
    if rows > ROWS {
        match random.index(4) {
            0 | 1 => (0..rows).collect(),
            2 => {
                let step = rows.div_ceil(ROWS);
                (random.index(step)..rows).step_by(step).collect()
            }
            _ => chosen(rows, ROWS, random),
        }
    } else if random.chance(0.15) {
        chosen(rows, rows / 2 + random.index(rows.div_ceil(2)), random)
    } else {
        (0..rows).collect()
    }
}

/// `n` rows of `rows`, ascending.
pub fn chosen(rows: usize, n: usize, random: &mut Random) -> Vec<usize> {
    let mut chosen: Vec<usize> = random.permutation(rows).into_iter().take(n.max(1)).collect();
    chosen.sort_unstable();
    chosen
}

/// Columns of a sector with `rows` rows.
fn sector(columns: usize, rows: usize) -> usize {
    (columns * ROWS / rows / COLUMN_STEP * COLUMN_STEP).max(COLUMN_STEP).min(columns)
}

/// These rows and `columns` columns from `first` on.
pub fn view(of: &LabeledImage, rows: &[usize], first: usize, columns: usize) -> LabeledImage {
    let n_bands = of.image.n_camera_bands();
    let n = rows.len() * columns;
    let mut pixels = vec![PolarPixel::default(); n];
    let mut truth = vec![UNKNOWN; n];
    let mut camera = vec![f32::NAN; n * n_bands];
    for (row, &from_row) in rows.iter().enumerate() {
        for column in 0..columns {
            let to = row * columns + column;
            let from = from_row * of.image.columns + (first + column) % of.image.columns;
            (pixels[to], truth[to]) = (of.image.pixels[from], of.truth[from]);
            camera[to * n_bands..][..n_bands].copy_from_slice(&of.image.camera[from * n_bands..][..n_bands]);
        }
    }
    let has_intensity = of.image.has_intensity;
    LabeledImage { image: PolarImage { rows: rows.len(), columns, pixels, has_intensity, camera }, truth }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(rows: usize, columns: usize) -> LabeledImage {
        let n = rows * columns;
        let pixel = |i: usize| PolarPixel { ray: [i as f32 + 1.0, 0.0, 0.0], ..PolarPixel::default() };
        let camera = (0..2 * n).map(|i| i as f32).collect();
        let pixels = (0..n).map(pixel).collect();
        LabeledImage {
            image: PolarImage { rows, columns, pixels, has_intensity: true, camera },
            truth: (0..n).map(|i| (i % 7) as u8).collect(),
        }
    }

    #[test]
    fn views_keep_pixels_together_with_their_class_and_colors() {
        let mut random = Random::new(5);
        let mut sizes = Vec::new();
        for rows in [64, 32, 16, 40] {
            for _ in 0..20 {
                let LabeledImage { image, truth } = random_view(image(rows, 512), &mut random);
                assert!(image.rows * image.columns <= ROWS * 512 && image.columns.is_multiple_of(COLUMN_STEP));
                assert!(image.rows >= 8 && truth.len() == image.pixels.len() && image.n_camera_bands() == 2);
                for (i, (pixel, class)) in image.pixels.iter().zip(&truth).enumerate() {
                    let from = pixel.ray[0] as usize - 1;
                    assert_eq!((usize::from(*class), image.camera[2 * i] as usize), (from % 7, 2 * from));
                }
                let firsts: Vec<f32> = image.pixels.iter().step_by(image.columns).map(|pixel| pixel.ray[0]).collect();
                assert!(firsts.is_sorted(), "rows stay in order");
                sizes.push((rows, image.rows, image.columns));
            }
        }
        for size in [(64, 64, 256), (64, 32, 512), (32, 32, 512), (16, 16, 512), (40, 40, 384)] {
            assert!(sizes.contains(&size), "{size:?}");
        }
    }
}
