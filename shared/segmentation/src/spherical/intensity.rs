//! Intensities of other sensors on the scale of the training.
//!
//! Sensors report the strength of a return on scales of their own: the median of roads is 11 of 255 for some, 66 for others. The
//! ground is in every street, and its intensities have similar shares of asphalt, paint and grass; so they show the scale.

use super::PolarImage;
use super::ring_gains::GroundByRing;
use messages::SubmapPoint;

/// Shares of the ground points whose intensities are compared.
const SHARES: [f32; N] = [0.05, 0.25, 0.5, 0.75, 0.95];
pub(super) const N: usize = 5;

/// Intensities of the ground below which 5, 25, 50, 75 and 95 % of its points lie.
pub type GroundIntensities = [u8; N];

/// Points within this distance of the ground are taken for the ground, m.
const GROUND_M: f32 = 0.15;
/// About so many points of a submap are examined: a pass over all would read the whole submap once more.
const SAMPLE: usize = 100_000;
/// Ground points below which the scale is not known.
const MIN_POINTS: u64 = 2000;
/// Factor from the median of the ground in the training up to which intensities are on its scale, in both directions. The ground of one
/// sensor is twice as bright under a tilted mounting as under an upright one. In simulated towns, intensities as recorded are better up
/// to a gain of 2, and normalized ones from 3 on.
const TOLERANCE: f32 = 3.0;

settings::words! {
    /// What a model takes from the intensities.
    #[derive(Default)]
    pub enum IntensityUse {
        /// As recorded if they are on the scale of the training, else brought to it.
        #[default]
        Auto = "auto",
        /// Brought to the scale of the training, ring by ring.
        Normalized = "normalized",
        /// As recorded.
        Raw = "raw",
        /// Nothing.
        Off = "off",
    }
}

/// Counts the intensities of ground points.
#[derive(Clone, Debug)]
pub struct GroundHistogram([u64; 256]);

/// Quantiles of the ground in simulated towns, for models without their own: points of the HDL-32E of the survey rig, urban, suburban,
/// rural and tunnel, seeds 9001 and 9002. `replica train` prints and stores those of its data.
const SIMULATED: GroundIntensities = [6, 10, 12, 14, 30];

impl Default for GroundHistogram {
    fn default() -> Self {
        Self([0; 256])
    }
}

impl GroundHistogram {
    /// Adds points with their heights above the ground, m.
    pub fn add(&mut self, points: impl Iterator<Item = (u8, f32)>) {
        for (intensity, _) in points.filter(|(_, height_m)| height_m.abs() < GROUND_M) {
            self.0[usize::from(intensity)] += 1;
        }
    }
    /// Adds points of one intensity.
    pub(super) fn add_counts(&mut self, intensity: u8, n: u64) {
        self.0[usize::from(intensity)] += n;
    }
    /// Numbers of points by intensity.
    pub(super) fn counts(&self) -> &[u64; 256] {
        &self.0
    }
    /// Adds the counts of another histogram.
    pub fn join(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, n)| *sum += n);
    }
    /// `None` if there are too few points, or all have intensity 0.
    pub fn quantiles(&self) -> Option<GroundIntensities> {
        let total: u64 = self.0.iter().sum();
        if total < MIN_POINTS || self.0[0] == total {
            return None;
        }
        Some(SHARES.map(|share| {
            let (wanted, mut sum) = ((f64::from(share) * total as f64) as u64, 0);
            let reached = |n: &u64| {
                sum += n;
                sum > wanted
            };
            self.0.iter().position(reached).unwrap_or(255) as u8
        }))
    }
}

/// What becomes of each intensity of a submap.
#[derive(Clone, Debug, PartialEq)]
pub enum IntensityMap {
    /// It stays.
    Unchanged,
    /// It gets the value of the training at the same share of the ground: values by intensity for each ring, the last ones also for
    /// the rings above.
    ByRing(Vec<[u8; 256]>),
    /// It is not known.
    Unknown,
}

impl IntensityMap {
    /// The map for a submap; and the medians of its ground and of that of the training, if it is on another scale. Without intensities
    /// of the training, those of simulated towns are taken.
    pub fn of(
        intensity_use: IntensityUse,
        points: &[SubmapPoint],
        heights_m: &[f32],
        trained: Option<GroundIntensities>,
    ) -> (Self, Option<[u8; 2]>) {
        let trained = trained.unwrap_or(SIMULATED);
        // An odd step: points are ordered by firings of 2^n rings, and all rings are to be counted.
        let step = (points.len() / SAMPLE) | 1;
        let sample = points.iter().zip(heights_m).step_by(step);
        let ground =
            GroundByRing::of(sample.map(|(point, height_m)| (usize::from(point.ring), point.intensity, *height_m)));
        let found = ground.quantiles();
        if intensity_use != IntensityUse::Raw && ground.is_constant() {
            return (Self::Unknown, None);
        }
        let foreign = found.filter(|found| !is_on_scale(*found, trained));
        let is_normalized = match intensity_use {
            IntensityUse::Off => return (Self::Unknown, None),
            IntensityUse::Auto => foreign.is_some(),
            IntensityUse::Normalized => true,
            IntensityUse::Raw => false,
        };
        let map = if is_normalized { ground.normalizing(trained) } else { None };
        let map = map.unwrap_or(Self::Unchanged);
        (map, foreign.map(|found| [found[N / 2], trained[N / 2]]))
    }

    /// What becomes of an intensity that is known.
    pub fn of_intensity(&self, ring: usize, intensity: u8) -> u8 {
        match self {
            Self::Unchanged => intensity,
            Self::ByRing(maps) => {
                maps.get(ring).or(maps.last()).map_or(intensity, |values| values[usize::from(intensity)])
            }
            Self::Unknown => 0,
        }
    }

    /// Changes the intensities of a sweep. Its lowest row is ring 0.
    pub fn apply(&self, image: &mut PolarImage) {
        match self {
            Self::Unchanged => {}
            Self::Unknown => image.has_intensity = false,
            Self::ByRing(_) => {
                for (ring, row) in image.pixels.chunks_exact_mut(image.columns.max(1)).rev().enumerate() {
                    for pixel in row {
                        pixel.intensity = self.of_intensity(ring, pixel.intensity);
                    }
                }
            }
        }
    }
}

/// Whether a median could be that of a training drive.
fn is_on_scale(found: GroundIntensities, trained: GroundIntensities) -> bool {
    let [found, trained] = [found, trained].map(|quantiles| f32::from(quantiles[N / 2]));
    found <= trained * TOLERANCE && found * TOLERANCE >= trained
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spherical::PolarPixel;

    const TRAINED: GroundIntensities = [6, 10, 12, 14, 30];

    /// Points of a street: two thirds ground with the intensities of the training, one third walls of intensity 200, times a gain.
    fn street(gain: f32) -> (Vec<SubmapPoint>, Vec<f32>) {
        let ground = |i: usize| match i % 20 {
            0 => 5.0,
            1..5 => 8.0,
            5..10 => 11.0,
            10..15 => 13.0,
            15..19 => 20.0,
            _ => 60.0,
        };
        let of_point = |i: usize| if i % 3 == 2 { (200.0, 2.0) } else { (ground(i / 3), 0.01) };
        let point = |(intensity, height_m): (f32, f32)| {
            (SubmapPoint { intensity: (gain * intensity).round() as u8, ..SubmapPoint::default() }, height_m)
        };
        (0..9000).map(of_point).map(point).unzip()
    }

    fn map(intensity_use: IntensityUse, gain: f32) -> (IntensityMap, Option<[u8; 2]>) {
        let (points, heights_m) = street(gain);
        IntensityMap::of(intensity_use, &points, &heights_m, Some(TRAINED))
    }

    #[test]
    fn intensities_on_the_scale_of_the_training_stay() {
        for gain in [0.6, 1.0, 1.8] {
            assert_eq!(map(IntensityUse::Auto, gain), (IntensityMap::Unchanged, None), "gain {gain}");
        }
    }

    #[test]
    fn intensities_on_another_scale_are_reported_and_normalized() {
        for (gain, median) in [(0.2, 3), (4.0, 52), (5.0, 65)] {
            let (auto, foreign) = map(IntensityUse::Auto, gain);
            assert_eq!(foreign, Some([median, 12]), "gain {gain}");
            assert_eq!(auto, map(IntensityUse::Normalized, gain).0, "gain {gain}");
            assert_eq!(auto.of_intensity(0, median), 12, "gain {gain}");
        }
        assert_eq!(map(IntensityUse::Raw, 5.0), (IntensityMap::Unchanged, Some([65, 12])));
        for gain in [1.0, 5.0] {
            assert_eq!(map(IntensityUse::Off, gain), (IntensityMap::Unknown, None));
        }
    }

    #[test]
    fn normalized_intensities_of_the_ground_are_those_of_the_training() {
        let (map, _) = map(IntensityUse::Normalized, 3.0);
        assert_eq!([0, 33, 39, 255].map(|intensity| map.of_intensity(0, intensity)), [0, 10, 12, 255]);
        assert!((0..=255).map(|intensity| map.of_intensity(0, intensity)).is_sorted());
        let pixel = PolarPixel { ray: [1.0; 3], intensity: 39, ..PolarPixel::default() };
        let mut image =
            PolarImage { rows: 1, columns: 1, pixels: vec![pixel], has_intensity: true, camera: Vec::new() };
        map.apply(&mut image);
        assert_eq!((image.pixels[0].intensity, image.has_intensity), (12, true));
        IntensityMap::Unknown.apply(&mut image);
        assert!(!image.has_intensity);
    }

    #[test]
    fn equal_intensities_of_the_ground_are_no_intensities() {
        let (mut points, heights_m) = street(1.0);
        for point in &mut points {
            point.intensity = 76;
        }
        for intensity_use in [IntensityUse::Auto, IntensityUse::Normalized, IntensityUse::Off] {
            let map = IntensityMap::of(intensity_use, &points, &heights_m, Some(TRAINED));
            assert_eq!(map, (IntensityMap::Unknown, None));
        }
        let raw = IntensityMap::of(IntensityUse::Raw, &points, &heights_m, Some(TRAINED));
        assert_eq!(raw, (IntensityMap::Unchanged, Some([76, 12])));
    }

    #[test]
    fn scale_of_little_ground_or_of_zeros_is_not_known() {
        let (points, heights_m) = street(5.0);
        let few = IntensityMap::of(IntensityUse::Auto, &points[..2000], &heights_m[..2000], Some(TRAINED));
        assert_eq!(few, (IntensityMap::Unchanged, None));
        let zeros = vec![SubmapPoint::default(); 9000];
        assert_eq!(
            IntensityMap::of(IntensityUse::Auto, &zeros, &heights_m, Some(TRAINED)),
            (IntensityMap::Unchanged, None)
        );
    }
}
