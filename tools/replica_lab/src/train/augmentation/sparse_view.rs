//! A sweep with fewer rings and points, as a sparser sensor at the same place would measure it.

use super::super::labeled_image::LabeledImage;
use super::thin_out;
use super::view::{chosen, view};
use random::Random;
use segmentation::spherical::{PolarImage, PolarPixel};

/// Rings of the sparsest sensor.
const MIN_ROWS: usize = 8;

/// A view of a sweep with fewer points.
pub struct SparseImage {
    pub image: PolarImage,
    /// The pixels that are left: the pixel of the view, and the one with the same point in the whole sweep.
    pub pixels: Vec<[u32; 2]>,
}

/// Removes rings, every n-th or at random, and in half of the cases single returns or close ones.
pub fn sparse_view(of: &LabeledImage, random: &mut Random) -> SparseImage {
    let columns = of.image.columns;
    let rows = fewer_rows(of.image.rows, random);
    let LabeledImage { mut image, mut truth } = view(of, &rows, 0, columns);
    if random.chance(0.5) {
        if random.chance(0.5) {
            thin_out(&mut image, &mut truth, random.range(0.03, 0.12));
        } else {
            lose_points(&mut image, 0.5 * random.unit(), random);
        }
    }
    let pixels = (0..image.pixels.len()).filter(|&pixel| image.pixels[pixel].is_valid());
    let pixels =
        pixels.map(|pixel| [pixel, rows[pixel / columns] * columns + pixel % columns].map(|pixel| pixel as u32));
    let pixels = pixels.collect();
    SparseImage { image, pixels }
}

/// At most three quarters of the rows, and at least a quarter of them or [`MIN_ROWS`].
fn fewer_rows(rows: usize, random: &mut Random) -> Vec<usize> {
    let fewest = (rows / 4).max(MIN_ROWS).min(rows);
    let step = 2 + random.index(3);
    if random.chance(0.5) && rows / step >= fewest {
        return (random.index(step)..rows).step_by(step).collect();
    }
    let most = (rows * 3 / 4).max(fewest);
    chosen(rows, fewest + random.index(most - fewest + 1), random)
}

/// Removes a share of the returns.
fn lose_points(image: &mut PolarImage, share: f32, random: &mut Random) {
    for pixel in &mut image.pixels {
        if random.chance(share) {
            *pixel = PolarPixel::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sweep in which every pixel has a ray of its own; one of five has no point.
    fn sweep(rows: usize) -> LabeledImage {
        let n = rows * 256;
        let ray = |i: usize| if i.is_multiple_of(5) { [0.0; 3] } else { [5.0 + 0.01 * i as f32, 1.0, 0.0] };
        let pixel = |i: usize| PolarPixel { ray: ray(i), ..PolarPixel::default() };
        let pixels = (0..n).map(pixel).collect();
        let image = PolarImage { rows, columns: 256, pixels, has_intensity: true, camera: Vec::new() };
        LabeledImage { image, truth: vec![0; n] }
    }

    #[test]
    fn pixels_of_sparse_view_show_the_points_of_the_sweep() {
        for rows in [64, 32, 16, 5] {
            let of = sweep(rows);
            let mut fewest = usize::MAX;
            let mut most = 0;
            let mut n_thinned = 0;
            for seed in 0..60 {
                let SparseImage { image, pixels } = sparse_view(&of, &mut Random::new(seed));
                assert_eq!(image.pixels.len(), image.rows * of.image.columns);
                assert_eq!(pixels.len(), image.pixels.iter().filter(|pixel| pixel.is_valid()).count());
                for [sparse, full] in pixels.iter().map(|pair| pair.map(|pixel| pixel as usize)) {
                    assert!(image.pixels[sparse] == of.image.pixels[full] && image.pixels[sparse].is_valid());
                }
                fewest = fewest.min(image.rows);
                most = most.max(image.rows);
                n_thinned += usize::from(pixels.len() * 10 < image.pixels.len() * 7);
            }
            let least = (rows / 4).max(8).min(rows);
            assert!(fewest >= least && most <= (rows * 3 / 4).max(least), "{fewest} to {most} of {rows} rows");
            assert!(rows < 16 || fewest < most, "{fewest} of {rows} rows");
            assert!((5..45).contains(&n_thinned), "{n_thinned} of 60 with fewer points");
        }
    }
}
