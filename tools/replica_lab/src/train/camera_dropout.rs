//! Table `augmentation` of recipes of networks on images: sweeps whose colors or spectra are unknown.

use random::Random;
use segmentation::spherical::{CameraBand, PolarImage};
use serde::{Deserialize, Serialize};

/// Random changes of the training images in addition to the changes that all images have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImageAugmentation {
    /// Probability that all colors of a sweep are unknown; 0.2 in the thesis (6.3.2).
    pub color_dropout: f32,
    /// Probability that all spectra of a sweep are unknown.
    pub spectrum_dropout: f32,
}

impl Default for ImageAugmentation {
    fn default() -> Self {
        Self { color_dropout: 0.2, spectrum_dropout: 0.2 }
    }
}

impl ImageAugmentation {
    /// The first violated rule, if any.
    pub fn problem(self) -> Option<String> {
        let keys = [("color_dropout", self.color_dropout), ("spectrum_dropout", self.spectrum_dropout)];
        // False for NaN.
        let wrong = keys.into_iter().find(|(_, value)| !(0.0..=1.0).contains(value));
        wrong.map(|(key, value)| format!("{key} = {value}; must be 0 to 1"))
    }
    /// Changes the measurements of the cameras, given by `bands`. Models without cameras use no random numbers.
    pub fn apply(self, image: &mut PolarImage, bands: &[CameraBand], random: &mut Random) {
        let is_spectral = |band: &CameraBand| matches!(band, CameraBand::Nm(_));
        for (spectral, probability) in [(false, self.color_dropout), (true, self.spectrum_dropout)] {
            let dropped: Vec<bool> = bands.iter().map(|band| is_spectral(band) == spectral).collect();
            if !dropped.contains(&true) || !random.chance(probability) {
                continue;
            }
            for of_pixel in image.camera.chunks_exact_mut(bands.len()) {
                let values = of_pixel.iter_mut().zip(&dropped).filter(|(_, is_dropped)| **is_dropped);
                values.for_each(|(value, _)| *value = f32::NAN);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BANDS: [CameraBand; 3] = [CameraBand::Red, CameraBand::Nm(650), CameraBand::Blue];

    fn image() -> PolarImage {
        PolarImage { rows: 1, columns: 2, pixels: Vec::new(), has_intensity: false, camera: vec![0.5; 6] }
    }

    #[test]
    fn colors_and_spectra_of_a_sweep_are_dropped_with_their_probabilities() {
        let augmentation = ImageAugmentation { color_dropout: 0.2, spectrum_dropout: 0.5 };
        let mut random = Random::new(1);
        let mut n_dropped = [0; 2];
        for _ in 0..2000 {
            let mut image = image();
            augmentation.apply(&mut image, &BANDS, &mut random);
            let unknown: Vec<bool> = image.camera.iter().map(|value| value.is_nan()).collect();
            let [color, spectrum] = [unknown[0], unknown[1]];
            assert_eq!(unknown, [color, spectrum, color, color, spectrum, color], "all of a sweep or none");
            n_dropped[0] += usize::from(color);
            n_dropped[1] += usize::from(spectrum);
        }
        assert!((340..460).contains(&n_dropped[0]) && (930..1070).contains(&n_dropped[1]), "{n_dropped:?}");
    }

    #[test]
    fn models_without_cameras_use_no_random_numbers() {
        let mut random = Random::new(1);
        let mut untouched = Random::new(1);
        let mut empty = PolarImage { camera: Vec::new(), ..image() };
        ImageAugmentation::default().apply(&mut empty, &[], &mut random);
        assert_eq!(random.bits(), untouched.bits());
    }
}
