//! Converts the intensities of other sensors to the scale of the training data.
//!
//! Sensors report the strength of a return on different scales: the median of roads is 11 of 255 for one sensor, 66 for
//! another. Ground is in every street, and its intensities have similar shares of asphalt, paint and grass, so they
//! determine the scale.

mod ground_histogram;
mod map;
mod ring_gains;

pub use ground_histogram::{GroundHistogram, GroundIntensities};
pub use map::IntensityMap;
pub use ring_gains::{GroundByRing, RingReturn};

use crate::sample::sample_step;
use ground_histogram::N;
use messages::SubmapPoint;

/// Factor between the medians of the ground and of the training up to which intensities are on the training scale, in
/// both directions. The ground of one sensor is twice as bright under a tilted mounting as under an upright one. In
/// simulated towns, recorded intensities are better up to a gain of 2, and normalized ones from 3 on.
const TOLERANCE: f32 = 3.0;

settings::words! {
    /// Use of the intensities in a model.
    #[derive(Default)]
    pub enum IntensityUse {
        /// Recorded intensities if they are on the scale of the training data, otherwise normalized ones, or none if
        /// the ground has only a few different ones.
        #[default]
        Auto = "auto",
        /// Intensities normalized to the scale of the training data, ring by ring.
        Normalized = "normalized",
        /// Recorded intensities.
        Raw = "raw",
        /// No intensities.
        Off = "off",
    }
}

/// Quantiles of the ground in simulated towns, for models without their own: points of the HDL-32E of the survey rig,
/// urban, suburban, rural and tunnel, seeds 9001 and 9002. `replica-lab train` prints and stores the quantiles of its
/// data.
const SIMULATED: GroundIntensities = [6, 10, 12, 14, 30];

/// The intensities of a submap, prepared for a model.
#[derive(Clone, Debug, PartialEq)]
pub struct SubmapIntensities {
    /// Conversion of each intensity.
    pub map: IntensityMap,
    /// The medians of the ground, if they show that the intensities are not on the scale of the training data.
    pub foreign: Option<ForeignIntensity>,
}

/// Median intensities of the ground on different scales.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignIntensity {
    /// Median in the submap.
    pub found: u8,
    /// Median in the training data.
    pub trained: u8,
}

impl SubmapIntensities {
    /// Finds the scale of the intensities of a submap from its ground. `heights_m` are the heights of the points above
    /// the ground. Without intensities of the training data, the ones of simulated towns are used.
    pub fn find(
        intensity_use: IntensityUse,
        points: &[SubmapPoint],
        heights_m: &[f32],
        trained: Option<GroundIntensities>,
    ) -> Self {
        const UNKNOWN: SubmapIntensities = SubmapIntensities { map: IntensityMap::Unknown, foreign: None };
        let trained = trained.unwrap_or(SIMULATED);
        let sample = points.iter().zip(heights_m).step_by(sample_step(points.len()));
        let ring_return = |(point, height_m): (&SubmapPoint, &f32)| RingReturn {
            ring: usize::from(point.ring),
            intensity: point.intensity,
            height_m: *height_m,
        };
        let ground = GroundByRing::from_returns(sample.map(ring_return));
        let found = ground.quantiles();
        if intensity_use != IntensityUse::Raw && ground.is_constant() {
            return UNKNOWN;
        }
        let foreign = found.filter(|found| !is_on_scale(*found, trained));
        let medians = |found: GroundIntensities| ForeignIntensity { found: found[N / 2], trained: trained[N / 2] };
        let is_normalized = match intensity_use {
            IntensityUse::Off => return UNKNOWN,
            IntensityUse::Auto if foreign.is_some() && ground.is_coarse() => {
                return Self { map: IntensityMap::Unknown, foreign: foreign.map(medians) };
            }
            IntensityUse::Auto => foreign.is_some(),
            IntensityUse::Normalized => true,
            IntensityUse::Raw => false,
        };
        let map = if is_normalized { ground.normalizing(trained) } else { None };
        let map = map.unwrap_or(IntensityMap::Unchanged);
        Self { map, foreign: foreign.map(medians) }
    }
}

/// Whether a training drive could have such a median.
fn is_on_scale(found: GroundIntensities, trained: GroundIntensities) -> bool {
    let [found, trained] = [found, trained].map(|quantiles| f32::from(quantiles[N / 2]));
    found <= trained * TOLERANCE && found * TOLERANCE >= trained
}

#[cfg(test)]
mod tests {
    use super::*;

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

    const UNCHANGED: SubmapIntensities = SubmapIntensities { map: IntensityMap::Unchanged, foreign: None };
    const UNKNOWN: SubmapIntensities = SubmapIntensities { map: IntensityMap::Unknown, foreign: None };

    fn foreign(found: u8) -> ForeignIntensity {
        ForeignIntensity { found, trained: 12 }
    }

    fn find(intensity_use: IntensityUse, gain: f32) -> SubmapIntensities {
        let (points, heights_m) = street(gain);
        SubmapIntensities::find(intensity_use, &points, &heights_m, Some(TRAINED))
    }

    #[test]
    fn intensities_on_the_scale_of_the_training_stay() {
        for gain in [0.6, 1.0, 1.8] {
            assert_eq!(find(IntensityUse::Auto, gain), UNCHANGED, "gain {gain}");
        }
    }

    #[test]
    fn intensities_on_another_scale_are_reported_and_normalized() {
        for (gain, median) in [(0.25, 3), (4.0, 52), (5.0, 65)] {
            let auto = find(IntensityUse::Auto, gain);
            assert_eq!(auto.foreign, Some(foreign(median)), "gain {gain}");
            assert_eq!(auto, find(IntensityUse::Normalized, gain), "gain {gain}");
            assert_eq!(auto.map.apply(0, median), 12, "gain {gain}");
        }
        assert_eq!(find(IntensityUse::Raw, 5.0), SubmapIntensities { foreign: Some(foreign(65)), ..UNCHANGED });
        for gain in [1.0, 5.0] {
            assert_eq!(find(IntensityUse::Off, gain), UNKNOWN);
        }
    }

    #[test]
    fn coarse_intensities_are_reported_and_not_used_unless_asked_for() {
        let auto = find(IntensityUse::Auto, 0.1);
        assert_eq!(auto, SubmapIntensities { foreign: Some(foreign(1)), ..UNKNOWN });
        assert!(matches!(find(IntensityUse::Normalized, 0.1).map, IntensityMap::ByRing(_)));
        // A third of the ground is at the end of the scale.
        let (mut points, heights_m) = street(5.0);
        for point in &mut points {
            point.intensity = point.intensity.min(80);
        }
        let saturated = SubmapIntensities::find(IntensityUse::Auto, &points, &heights_m, Some(TRAINED));
        assert_eq!(saturated, SubmapIntensities { foreign: Some(foreign(65)), ..UNKNOWN });
    }

    #[test]
    fn normalized_intensities_of_the_ground_are_those_of_the_training() {
        let SubmapIntensities { map, .. } = find(IntensityUse::Normalized, 3.0);
        assert_eq!([0, 33, 39, 255].map(|intensity| map.apply(0, intensity)), [0, 10, 12, 60]);
        assert!((0..=255).map(|intensity| map.apply(0, intensity)).is_sorted());
    }

    #[test]
    fn equal_intensities_of_the_ground_are_no_intensities() {
        let (mut points, heights_m) = street(1.0);
        for point in &mut points {
            point.intensity = 76;
        }
        for intensity_use in [IntensityUse::Auto, IntensityUse::Normalized, IntensityUse::Off] {
            let map = SubmapIntensities::find(intensity_use, &points, &heights_m, Some(TRAINED));
            assert_eq!(map, UNKNOWN);
        }
        let raw = SubmapIntensities::find(IntensityUse::Raw, &points, &heights_m, Some(TRAINED));
        assert_eq!(raw, SubmapIntensities { foreign: Some(foreign(76)), ..UNCHANGED });
    }

    #[test]
    fn scale_of_little_ground_or_of_zeros_is_not_known() {
        let (points, heights_m) = street(5.0);
        let few = SubmapIntensities::find(IntensityUse::Auto, &points[..2000], &heights_m[..2000], Some(TRAINED));
        assert_eq!(few, UNCHANGED);
        let zeros = vec![SubmapPoint::default(); 9000];
        assert_eq!(SubmapIntensities::find(IntensityUse::Auto, &zeros, &heights_m, Some(TRAINED)), UNCHANGED);
    }
}
