//! Random changes of sweeps in training; those of gain and height are for points, too.

use random::Random;
use segmentation::spherical::{PolarImage, PolarPixel};
use training::UNKNOWN;

/// A factor of all intensities.
pub fn random_gain(random: &mut Random) -> f32 {
    random.range(0.7, 1.4)
}

/// An error of all heights above the ground, m.
pub fn random_height_error_m(random: &mut Random) -> f32 {
    0.04 * random.gauss()
}

/// Rotates and mirrors a sweep at random, adds noise, and removes returns as a worse sensor would.
pub fn augment(image: &mut PolarImage, truth: &mut [u8], without_intensity: f32, random: &mut Random) {
    let columns = image.columns;
    let turn = random.index(columns);
    let (mirror, turn_up) = (random.chance(0.5), random.range(-std::f32::consts::PI, std::f32::consts::PI));
    let (sin, cos) = turn_up.sin_cos();
    let range_scale = random.range(0.95, 1.05);
    let height_error_m = random_height_error_m(random);
    let noise_m = 0.03 * random.unit();
    let lost = if random.chance(0.3) { 0.3 * random.unit() } else { 0.0 };
    let lost_rows = if random.chance(0.2) { 0.5 * random.unit() } else { 0.0 };
    let gain = random_gain(random);
    if random.chance(without_intensity) {
        image.has_intensity = false;
    }
    turn_camera(image, turn, mirror);
    for (row, truth) in image.pixels.chunks_exact_mut(columns).zip(truth.chunks_exact_mut(columns)) {
        let row_lost = random.chance(lost_rows);
        row.rotate_left(turn);
        truth.rotate_left(turn);
        if mirror {
            row.reverse();
            truth.reverse();
        }
        for (pixel, truth) in row.iter_mut().zip(truth) {
            if row_lost || !pixel.is_valid() || random.chance(lost) {
                (*pixel, *truth) = (PolarPixel::default(), UNKNOWN);
                continue;
            }
            let [x, y, z] = pixel.ray;
            let y = if mirror { -y } else { y };
            let scale = range_scale + noise_m * random.gauss() / pixel.range_m();
            pixel.ray = [(cos * x - sin * y) * scale, (sin * x + cos * y) * scale, z * scale];
            pixel.height_m = pixel.height_m * range_scale + height_error_m;
            pixel.intensity = (f32::from(pixel.intensity) * gain).min(255.0) as u8;
        }
    }
}

/// Rotates and mirrors the measurements of the cameras. Those of removed returns stay: a pixel without a point has no features.
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
