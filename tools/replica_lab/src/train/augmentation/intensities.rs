//! Intensities as another sensor would report them.

use random::Random;
use segmentation::intensity::{GroundByRing, GroundIntensities, RingReturn};
use segmentation::spherical::PolarImage;

/// Share of the sweeps with intensities that imitate another sensor.
const FOREIGN: f32 = 0.5;

/// Changes intensities at random, for a model that scales intensities of other sensors to its training (`trained`, intensities of
/// the ground). `truth` has the class of each pixel.
pub fn augment_intensities(
    image: &mut PolarImage,
    truth: &[u8],
    trained: Option<GroundIntensities>,
    random: &mut Random,
) {
    let Some(trained) = trained.filter(|_| random.chance(FOREIGN)) else {
        let gain = super::random_gain(random);
        return change(image, |_, intensity, _| gain * intensity);
    };
    // Gains of 0.1 to 10.
    let gain = 10_f32.powf(random.range(-1.0, 1.0));
    let exponent = super::random_exponent(random);
    let by_range = random.range(-0.5, 0.5);
    // Surfaces of the simulator differ from surfaces of a real street.
    let of_class: Vec<f32> = (0..=u8::MAX).map(|_| (0.3 * random.gauss()).exp()).collect();
    // The lasers of some units differ by a factor of two.
    let of_row: Vec<f32> = (0..image.rows).map(|_| (0.4 * random.gauss()).exp()).collect();
    let columns = image.columns;
    let median = f32::from(trained[trained.len() / 2]).max(1.0);
    change(image, |range_m, intensity, pixel| {
        let factor = gain * of_row[pixel / columns] * of_class[usize::from(truth[pixel])];
        factor * median * (intensity / median).powf(exponent) * (range_m / 10.0).powf(by_range)
    });
    let pixels = image.pixels.iter().enumerate().filter(|(_, pixel)| pixel.is_valid());
    // The lowest row is ring 0.
    let ring = |index: usize| image.rows - 1 - index / columns;
    let returns = pixels.map(|(index, pixel)| RingReturn {
        ring: ring(index),
        intensity: pixel.intensity,
        height_m: pixel.height_m,
    });
    let ground = GroundByRing::from_returns(returns);
    match ground.normalizing(trained) {
        Some(map) => image.apply_intensities(&map),
        None => image.has_intensity = false,
    }
}

/// Replaces the intensity of each return; `f` receives range in m, intensity and pixel.
fn change(image: &mut PolarImage, f: impl Fn(f32, f32, usize) -> f32) {
    for (index, pixel) in image.pixels.iter_mut().enumerate().filter(|(_, pixel)| pixel.is_valid()) {
        let changed = f(pixel.range_m(), f32::from(pixel.intensity), index);
        pixel.intensity = changed.round().clamp(0.0, 255.0) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use segmentation::spherical::PolarPixel;

    const TRAINED: GroundIntensities = [6, 10, 12, 14, 30];

    /// A sweep of ground points with the intensities of the training.
    fn ground() -> PolarImage {
        let intensity = |i: usize| [5, 8, 8, 8, 11, 11, 11, 13, 13, 25][i % 10];
        let pixel = |i: usize| PolarPixel { ray: [10.0, 0.0, -2.0], height_m: 0.0, intensity: intensity(i) };
        PolarImage {
            rows: 10,
            columns: 1000,
            pixels: (0..10_000).map(pixel).collect(),
            has_intensity: true,
            camera: Vec::new(),
        }
    }

    fn median(image: &PolarImage) -> u8 {
        let mut intensities: Vec<u8> = image.pixels.iter().map(|pixel| pixel.intensity).collect();
        intensities.sort_unstable();
        intensities[intensities.len() / 2]
    }

    #[test]
    fn intensities_of_other_sensors_come_back_to_the_scale_of_the_training() {
        let truth = vec![0; 10_000];
        let mut medians = Vec::new();
        for seed in 0..40 {
            let mut image = ground();
            augment_intensities(&mut image, &truth, Some(TRAINED), &mut Random::new(seed));
            assert!(image.has_intensity);
            medians.push(median(&image));
        }
        // Sweeps of the same sensor have gains of 0.7 to 1.4.
        assert!(medians.iter().all(|median| (7..=16).contains(median)), "{medians:?}");
        assert!(medians.iter().filter(|median| (10..=13).contains(*median)).count() > 20, "{medians:?}");
    }

    #[test]
    fn without_intensities_of_the_training_only_the_gain_changes() {
        let truth = vec![0; 10_000];
        let mut image = ground();
        augment_intensities(&mut image, &truth, None, &mut Random::new(1));
        let gain = super::super::random_gain(&mut Random::new(1));
        assert_eq!(image.pixels[0].intensity, (5.0 * gain).round() as u8);
    }
}
