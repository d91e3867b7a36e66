//! Sensor chip of the mosaic cameras: bias, dark current, non-uniformity, defective pixels, noise and quantization.

use random::{gauss, hash, unit};

/// Columns and rows of the raw image.
pub const SIZE: [usize; 2] = [2048, 1088];
/// Bits of a sample.
pub const BIT_DEPTH: u32 = 10;
/// Largest sample.
pub const FULL: f32 = 1023.0;
/// Full well capacity, electrons.
pub const FULL_WELL: f32 = 11_000.0;
/// Level without light (bias), counts.
const BIAS: f32 = 16.0;
/// Mean dark current of a warm chip, counts per ms.
const DARK_PER_MS: f32 = 0.05;
/// Electrons per count.
const ELECTRONS: f32 = FULL_WELL / FULL;
/// Read noise, counts.
const READ_NOISE: f32 = 0.8;
/// Fixed-pattern noise, half widths: bias of pixels and of columns (counts), gain of pixels (share).
const FIXED_PATTERN: [f32; 3] = [1.2, 0.8, 0.012];
/// One pixel in this many is defective.
const DEFECT_EVERY: u64 = 60_000;

/// Defect of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// Always saturated.
    Hot,
    /// Always zero.
    Dead,
}

/// One chip. Its non-uniformity and defects depend on its serial number, not on the drive.
#[derive(Clone, Copy, Debug)]
pub struct Chip(u64);

/// A pixel with a defect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DefectivePixel {
    /// Column.
    pub u: usize,
    /// Row.
    pub v: usize,
    /// Defect.
    pub defect: Defect,
}

impl Chip {
    /// The chip of a serial number.
    pub fn new(sensor_id: &str) -> Self {
        Self(sensor_id.bytes().fold(0x00c4_1900, |seed, byte| hash(seed, u64::from(byte))))
    }

    /// Defective pixels, row by row.
    pub fn defects(self) -> impl Iterator<Item = DefectivePixel> {
        let pixels = (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (u, v)));
        pixels.filter_map(move |(u, v)| self.defect(u, v).map(|defect| DefectivePixel { u, v, defect }))
    }

    /// Defect of a pixel, if any.
    pub fn defect(self, u: usize, v: usize) -> Option<Defect> {
        match self.pixel_hash(u, v) % (2 * DEFECT_EVERY) {
            0 => Some(Defect::Hot),
            1 => Some(Defect::Dead),
            _ => None,
        }
    }

    /// Sample of a pixel that receives `light` counts.
    pub fn read_out(self, [u, v]: [usize; 2], light: f32, exposure_ms: f32, seed: u64) -> u16 {
        match self.defect(u, v) {
            Some(Defect::Hot) => return FULL as u16,
            Some(Defect::Dead) => return 0,
            None => {}
        }
        let pixel = self.pixel_hash(u, v);
        let around_zero = |random: u64| 2.0 * unit(random) - 1.0;
        let column = hash(self.0 ^ 0xc0_1000, u as u64);
        let bias = BIAS + FIXED_PATTERN[0] * around_zero(pixel << 8) + FIXED_PATTERN[1] * around_zero(column);
        // A few pixels have a dark current far above the mean.
        let dark = DARK_PER_MS * exposure_ms * -unit(pixel << 16).max(1e-6).ln();
        let light = light * (1.0 + FIXED_PATTERN[2] * around_zero(pixel << 24));
        let random = hash(seed, (v * SIZE[0] + u) as u64);
        let noise = (READ_NOISE * READ_NOISE + (light + dark) / ELECTRONS).sqrt() * gauss(random);
        (bias + dark + light + noise).round().clamp(0.0, FULL) as u16
    }

    fn pixel_hash(self, u: usize, v: usize) -> u64 {
        hash(self.0, (v * SIZE[0] + u) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Statistics of a chip's samples.
    #[derive(Debug, PartialEq)]
    struct Statistics {
        mean: f64,
        deviation: f64,
    }

    fn statistics(light: f32, exposure_ms: f32) -> Statistics {
        let chip = Chip::new("a chip");
        let pixels = (0..40_000).map(|i| [i % 200, i / 200]).filter(|[u, v]| chip.defect(*u, *v).is_none());
        let samples: Vec<f64> = pixels.map(|at| f64::from(chip.read_out(at, light, exposure_ms, 5))).collect();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / samples.len() as f64;
        Statistics { mean, deviation: variance.sqrt() }
    }

    #[test]
    fn samples_grow_with_light_and_dark_current_and_saturate() {
        let Statistics { mean: dark, deviation: spread } = statistics(0.0, 5.0);
        assert!((dark - 16.25).abs() < 0.1 && (1.0..1.8).contains(&spread), "{dark} {spread}");
        let long = statistics(0.0, 100.0).mean;
        assert!((long - dark - 4.75).abs() < 0.15, "{long}");
        let Statistics { mean: lit, deviation: spread } = statistics(400.0, 5.0);
        // The shot noise of 4300 electrons is 6.1 counts, the gain non-uniformity 2.8.
        assert!((lit - dark - 400.0).abs() < 0.5 && (6.0..8.0).contains(&spread), "{lit} {spread}");
        assert_eq!(statistics(3000.0, 5.0), Statistics { mean: 1023.0, deviation: 0.0 });
    }

    #[test]
    fn defective_pixels_are_few_and_fixed() {
        let chip = Chip::new("13.8.0.2");
        let defects: Vec<_> = chip.defects().collect();
        assert!((15..80).contains(&defects.len()), "{}", defects.len());
        for DefectivePixel { u, v, defect } in &defects {
            let expected = if *defect == Defect::Hot { 1023 } else { 0 };
            assert!((0..5).all(|seed| chip.read_out([*u, *v], 300.0, 5.0, seed) == expected));
        }
        assert!(defects.iter().any(|d| d.defect == Defect::Hot) && defects.iter().any(|d| d.defect == Defect::Dead));
        assert_ne!(defects, Chip::new("9.4.0.3").defects().collect::<Vec<_>>());
    }
}
