//! Random changes of sweeps in training; gain and height are also changed for points.

mod ground_shape;
mod intensities;
mod sparse_view;
mod spheres;
mod view;

use super::labeled_image::LabeledImage;
pub use ground_shape::GroundShape;
use intensities::augment_intensities;
use random::Random;
use segmentation::intensity::GroundIntensities;
use segmentation::spherical::{PolarImage, PolarPixel};
pub use sparse_view::{SparseImage, sparse_view};
pub use spheres::{change_intensities, reshape_ground, shift_heights};
use training::UNKNOWN;
use view::random_view;

/// A factor of all intensities.
pub fn random_gain(random: &mut Random) -> f32 {
    random.range(0.7, 1.4)
}

/// An exponent of all intensities: some drivers report amplitudes, some powers, some reflectances.
pub fn random_exponent(random: &mut Random) -> f32 {
    2_f32.powf(random.range(-1.0, 1.0))
}

/// An error of all heights above the ground, m.
pub fn random_height_error_m(random: &mut Random) -> f32 {
    0.04 * random.gauss()
}

/// Changes a sweep at random, as if another sensor at another place had measured it: see the functions that it calls.
pub fn augment(
    of: LabeledImage,
    without_intensity: f32,
    trained: Option<GroundIntensities>,
    ground_shape: &GroundShape,
    random: &mut Random,
) -> LabeledImage {
    let mut of = random_view(of, random);
    let LabeledImage { image, truth } = &mut of;
    lose_returns(image, truth, random);
    if random.chance(0.3) {
        thin_out(image, truth, random.range(0.03, 0.12));
    }
    turn(image, truth, random);
    reshape_image_ground(image, truth, ground_shape, random);
    disturb(image, random);
    if random.chance(without_intensity) {
        image.has_intensity = false;
    } else {
        augment_intensities(image, truth, trained, random);
    }
    of
}

/// Removes single returns, rows, a sector or far returns, as a worse or covered sensor would.
fn lose_returns(image: &mut PolarImage, truth: &mut [u8], random: &mut Random) {
    let columns = image.columns;
    let lost = if random.chance(0.4) { 0.5 * random.unit() } else { 0.0 };
    let lost_rows = if random.chance(0.2) { 0.5 * random.unit() } else { 0.0 };
    let far_m = if random.chance(0.3) { random.range(20.0, 100.0) } else { f32::INFINITY };
    let hidden = if random.chance(0.15) { random.index(columns / 4) } else { 0 };
    let first_hidden = random.index(columns);
    for (row, truth) in image.pixels.chunks_exact_mut(columns).zip(truth.chunks_exact_mut(columns)) {
        let row_lost = random.chance(lost_rows);
        for (column, (pixel, truth)) in row.iter_mut().zip(truth).enumerate() {
            let is_hidden = (column + columns - first_hidden) % columns < hidden;
            // Returns become fewer with the distance beyond the limit.
            let is_far = random.unit() * pixel.range_m() > far_m;
            if row_lost || is_hidden || is_far || !pixel.is_valid() || random.chance(lost) {
                *pixel = PolarPixel::default();
                *truth = UNKNOWN;
            }
        }
    }
}

/// Removes returns closer to the one before than `step_m`: many published clouds have one point for each small cell.
fn thin_out(image: &mut PolarImage, truth: &mut [u8], step_m: f32) {
    for (row, truth) in image.pixels.chunks_exact_mut(image.columns).zip(truth.chunks_exact_mut(image.columns)) {
        let mut last = [f32::INFINITY; 3];
        for (pixel, truth) in row.iter_mut().zip(truth).filter(|(pixel, _)| pixel.is_valid()) {
            let square: f32 = pixel.ray.iter().zip(last).map(|(v, last)| (v - last) * (v - last)).sum();
            if square < step_m * step_m {
                *pixel = PolarPixel::default();
                *truth = UNKNOWN;
            } else {
                last = pixel.ray;
            }
        }
    }
}

/// Changes the heights of the ground.
fn reshape_image_ground(image: &mut PolarImage, truth: &[u8], ground_shape: &GroundShape, random: &mut Random) {
    ground_shape.each_change(truth, random, |pixel, change_m| {
        let pixel = &mut image.pixels[pixel];
        pixel.ray[2] += change_m;
        pixel.height_m += change_m;
    });
}

/// Rotates and mirrors the image: the start of a revolution is arbitrary, and streets may be mirrored.
fn turn(image: &mut PolarImage, truth: &mut [u8], random: &mut Random) {
    let columns = image.columns;
    let turn = random.index(columns);
    let mirror = random.chance(0.5);
    let (sin, cos) = random.range(-std::f32::consts::PI, std::f32::consts::PI).sin_cos();
    turn_camera(image, turn, mirror);
    for (row, truth) in image.pixels.chunks_exact_mut(columns).zip(truth.chunks_exact_mut(columns)) {
        row.rotate_left(turn);
        truth.rotate_left(turn);
        if mirror {
            row.reverse();
            truth.reverse();
        }
        for pixel in row {
            let [x, y, z] = pixel.ray;
            let y = if mirror { -y } else { y };
            pixel.ray = [cos * x - sin * y, sin * x + cos * y, z];
        }
    }
}

/// Adds errors of single ranges, of the ranges and elevations of whole rows, of the scale, and of the ground's height.
fn disturb(image: &mut PolarImage, random: &mut Random) {
    let scale = random.range(0.95, 1.05);
    let height_error_m = random_height_error_m(random);
    let noise_m = if random.chance(0.5) { 0.05 * random.unit() } else { 0.0 };
    // The rows of an HDL-64E are off by a few centimeters and up to 0.2 degrees.
    let [row_noise_m, row_noise] =
        if random.chance(0.4) { [0.03, 0.003].map(|most| most * random.unit()) } else { [0.0; 2] };
    for row in image.pixels.chunks_exact_mut(image.columns) {
        let [range_error_m, elevation_error] = [row_noise_m, row_noise].map(|sigma| sigma * random.gauss());
        for pixel in row.iter_mut().filter(|pixel| pixel.is_valid()) {
            let range_m = pixel.range_m();
            let factor = scale + (range_error_m + noise_m * random.gauss()) / range_m;
            let before_m = scale * pixel.ray[2];
            pixel.ray = pixel.ray.map(|v| v * factor);
            pixel.ray[2] += elevation_error * range_m;
            pixel.height_m = scale * pixel.height_m + pixel.ray[2] - before_m + height_error_m;
        }
    }
}

/// Rotates and mirrors the measurements of the cameras. Removed returns keep them: a pixel without a point has no features.
fn turn_camera(image: &mut PolarImage, turn: usize, mirror: bool) {
    let n_bands = image.n_camera_bands();
    if n_bands == 0 {
        return;
    }
    for row in image.camera.chunks_exact_mut(image.columns * n_bands) {
        row.rotate_left(turn * n_bands);
        if mirror {
            row.reverse();
            row.chunks_exact_mut(n_bands).for_each(<[f32]>::reverse);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A floor 2 m below the sensor, in 32 rows; class 0 on the left and 1 on the right.
    fn floor() -> LabeledImage {
        let rows = 32;
        let columns = 512;
        let pixel = |i: usize| {
            let down = (5.0 + (i / columns) as f32).to_radians();
            let azimuth = (i % columns) as f32 / columns as f32 * std::f32::consts::TAU;
            let flat_m = 2.0 / down.tan();
            let ray = [flat_m * azimuth.cos(), flat_m * azimuth.sin(), -2.0];
            PolarPixel { ray, height_m: 0.0, intensity: 8 + (i % 9) as u8 }
        };
        LabeledImage {
            image: PolarImage {
                rows,
                columns,
                pixels: (0..rows * columns).map(pixel).collect(),
                has_intensity: true,
                camera: Vec::new(),
            },
            truth: (0..rows * columns).map(|i| u8::from(i % columns < columns / 2)).collect(),
        }
    }

    fn rough_second_class() -> GroundShape {
        GroundShape::new(&["building", "terrain"].map(str::to_owned))
    }

    #[test]
    fn heights_follow_the_points_and_lost_points_have_no_class() {
        let mut n_lost = 0;
        for seed in 0..40 {
            let ground_shape = rough_second_class();
            let augmented = || augment(floor(), 0.5, Some([8, 10, 12, 14, 16]), &ground_shape, &mut Random::new(seed));
            let LabeledImage { image, truth } = augmented();
            assert!(augmented().image == image, "seed {seed} gives the same image again");
            let mut offsets: Vec<f32> = Vec::new();
            for (pixel, class) in image.pixels.iter().zip(&truth) {
                assert_eq!(pixel.is_valid(), *class != UNKNOWN);
                if pixel.is_valid() {
                    offsets.push(pixel.height_m - pixel.ray[2]);
                } else {
                    n_lost += 1;
                }
            }
            offsets.sort_by(f32::total_cmp);
            let [first, last] = [offsets[0], offsets[offsets.len() - 1]];
            assert!(last - first < 1e-3 && (1.7..2.3).contains(&first), "seed {seed}: {first} to {last} m");
        }
        assert!(n_lost > 10_000, "{n_lost}");
    }

    #[test]
    fn thinned_points_keep_their_distance() {
        let LabeledImage { mut image, mut truth } = floor();
        thin_out(&mut image, &mut truth, 0.1);
        let kept = |row: usize| image.pixels[row * 512..][..512].iter().filter(|pixel| pixel.is_valid()).count();
        // 23 m around the lowest row: steps of 4 cm; 144 m around the highest: steps of 28 cm.
        assert!((100..250).contains(&kept(31)) && kept(0) == 512, "{} {}", kept(31), kept(0));
    }

    #[test]
    fn only_the_rough_class_is_roughened() {
        let LabeledImage { mut image, truth } = floor();
        reshape_image_ground(&mut image, &truth, &rough_second_class(), &mut Random::new(2));
        for (pixel, class) in image.pixels.iter().zip(&truth) {
            assert_eq!(pixel.height_m == 0.0, *class == 0);
        }
    }
}
