//! From light to an image: lens glare and vignetting, sensor noise, color matrix and tone curve.

use random::{gauss, hash};
use rayon::prelude::*;

/// Light by color: 1 saturates the sensor at gain 1.
pub type Rgb = [f32; 3];

/// Electrons of a saturated pixel at gain 1.
const FULL_WELL: f32 = 7000.0;
/// Standard deviation of the read-out noise, electrons.
const READ_NOISE: f32 = 9.0;
/// Share of all light that lens and housing scatter over the whole image.
const GLARE: f32 = 0.012;
/// Matrix from the overlapping filters of the sensor to the colors of sRGB. Rows sum to 1: white stays white.
const COLOR_MATRIX: [[f32; 3]; 3] = [[1.30, -0.24, -0.06], [-0.17, 1.32, -0.15], [0.0, -0.22, 1.22]];
/// Pixels per piece of parallel work.
const PIECE: usize = 4096;

/// The image: sRGB, three bytes per pixel. Pixels outside the field of view are black.
pub fn develop(light: &[Rgb], shading: &[f32], gain: f32, seed: u64) -> Vec<u8> {
    // Saturated pixels are clipped, so that the sun does not dominate the mean.
    let mean = |c: usize| light.iter().map(|rgb| f64::from(rgb[c].min(4.0 / gain))).sum::<f64>() / light.len() as f64;
    let glare: Rgb = std::array::from_fn(|c| GLARE * mean(c) as f32);
    let mut image = vec![0_u8; 3 * light.len()];
    image.par_chunks_mut(3 * PIECE).enumerate().for_each(|(piece, bytes)| {
        for (k, bytes) in bytes.chunks_exact_mut(3).enumerate() {
            let i = piece * PIECE + k;
            if shading[i] <= 0.0 {
                continue;
            }
            let read = |c: usize| {
                let electrons = FULL_WELL * (light[i][c] * shading[i] + glare[c]);
                let noise = (electrons + READ_NOISE * READ_NOISE).sqrt() * gauss(hash(seed, (i * 3 + c) as u64));
                // Clipped at the full well.
                ((electrons + noise) / FULL_WELL * gain).clamp(0.0, 1.0)
            };
            let raw: Rgb = std::array::from_fn(read);
            for (byte, row) in bytes.iter_mut().zip(COLOR_MATRIX) {
                let linear: f32 = row.iter().zip(raw).map(|(weight, level)| weight * level).sum();
                *byte = (255.0 * tone(linear)).round() as u8;
            }
        }
    });
    image
}

/// Tone curve from a linear level (1 = full) to a display level, 0 to 1: sRGB (IEC 61966-2-1) with a shoulder for highlights
/// and darkened shadows.
pub fn tone(linear: f32) -> f32 {
    let held = linear.max(0.0);
    let shoulder = 1.22 * held / (1.0 + 0.22 * held);
    let coded = if shoulder <= 0.003_130_8 { 12.92 * shoulder } else { 1.055 * shoulder.powf(1.0 / 2.4) - 0.055 };
    let clipped = coded.clamp(0.0, 1.0);
    // A weak S curve around the middle.
    clipped + 0.25 * clipped * (1.0 - clipped) * (2.0 * clipped - 0.9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_curve_rises_from_black_to_white() {
        let levels: Vec<f32> = (0..=200).map(|i| tone(i as f32 / 200.0)).collect();
        assert!(levels[0] == 0.0 && levels[200] > 0.999 && levels.is_sorted());
        assert!((0.35..0.6).contains(&tone(0.18)), "{}", tone(0.18));
        for row in COLOR_MATRIX {
            assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn noise_grows_with_gain_and_saturated_pixels_are_white() {
        let spread = |gain: f32| {
            let light = vec![[0.3 / gain; 3]; 20_000];
            let image = develop(&light, &vec![1.0; 20_000], gain, 7);
            let mean = image.iter().map(|b| f64::from(*b)).sum::<f64>() / image.len() as f64;
            (image.iter().map(|b| (f64::from(*b) - mean).powi(2)).sum::<f64>() / image.len() as f64).sqrt()
        };
        let low = spread(1.0);
        let high = spread(8.0);
        // Shot noise of 2100 and of 262 electrons, through a matrix and a curve.
        assert!(low > 1.0 && high > 2.4 * low && high < 4.0 * low, "{low} {high}");
        assert_eq!(develop(&[[9.0; 3]], &[1.0], 1.0, 3), [255, 255, 255]);
        assert_eq!(develop(&[[0.4; 3]], &[0.0], 1.0, 3), [0, 0, 0]);
    }
}
