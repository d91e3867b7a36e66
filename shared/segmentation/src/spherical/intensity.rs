//! Intensities of other sensors on the scale of the training.
//!
//! Sensors report the strength of a return on scales of their own: the median of roads is 11 of 255 for some, 66 for others. The
//! ground is in every street, and its intensities have similar shares of asphalt, paint and grass; so they show the scale.

use super::PolarImage;
use messages::SubmapPoint;

/// Shares of the ground points whose intensities are compared.
const SHARES: [f32; N] = [0.05, 0.25, 0.5, 0.75, 0.95];
const N: usize = 5;

/// Intensities of the ground below which these [shares](SHARES) of its points lie.
pub type GroundIntensities = [u8; N];

/// Points within this distance of the ground are taken for the ground, m.
const GROUND_M: f32 = 0.15;
/// Ground points below which the scale is not known.
const MIN_POINTS: u64 = 2000;
/// The median of the ground of the training is multiplied and divided by this: `auto` leaves intensities with a median in between as
/// they are. Training varies them by factors of 0.7 to 1.4.
const TOLERANCE: f32 = 1.6;

/// What a model takes from the intensities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IntensityUse {
    /// As recorded if they are on the scale of the training, else normalized.
    #[default]
    Auto,
    /// Brought to the scale of the training.
    Normalized,
    /// As recorded.
    Raw,
    /// Nothing.
    Off,
}

impl IntensityUse {
    /// The use of a word of the settings; `None` if there is no such word.
    pub fn from_word(word: &str) -> Option<Self> {
        match word {
            "auto" => Some(Self::Auto),
            "normalized" => Some(Self::Normalized),
            "raw" => Some(Self::Raw),
            "off" => Some(Self::Off),
            _ => None,
        }
    }
}

/// Counts the intensities of ground points.
#[derive(Clone, Debug)]
pub struct GroundHistogram([u64; 256]);

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
    /// It gets the value of the training at the same share of the ground.
    To(Box<[u8; 256]>),
    /// It is not known.
    Unknown,
}

impl IntensityMap {
    /// The map for a submap; and the medians of its ground and of that of the training, if it is on another scale.
    pub fn of(
        intensity_use: IntensityUse,
        points: &[SubmapPoint],
        heights_m: &[f32],
        trained: &GroundIntensities,
    ) -> (Self, Option<[u8; 2]>) {
        let mut histogram = GroundHistogram::default();
        histogram.add(points.iter().map(|point| point.intensity).zip(heights_m.iter().copied()));
        let found = histogram.quantiles();
        let foreign = found.filter(|found| !is_on_scale(found, trained));
        let map = match (intensity_use, found) {
            (IntensityUse::Off, _) => Self::Unknown,
            (IntensityUse::Normalized, Some(found)) => Self::between(&found, trained),
            (IntensityUse::Auto, Some(found)) if foreign.is_some() => Self::between(&found, trained),
            _ => Self::Unchanged,
        };
        (map, foreign.map(|found| [found[N / 2], trained[N / 2]]))
    }

    /// Linear between the quantiles; above the last, the rest of both scales.
    fn between(found: &GroundIntensities, trained: &GroundIntensities) -> Self {
        let mut knots = vec![(0.0_f32, 0.0_f32)];
        for (from, to) in found.iter().zip(trained).map(|(from, to)| (f32::from(*from), f32::from(*to))) {
            // Equal quantiles of a coarse scale are one knot.
            if knots.last().is_some_and(|last| from > last.0) {
                knots.push((from, to));
            }
        }
        if knots.last().is_some_and(|last| last.0 < 255.0) {
            knots.push((255.0, 255.0));
        }
        let value = |intensity: f32| {
            let after = knots.iter().position(|knot| knot.0 >= intensity).unwrap_or(knots.len() - 1).max(1);
            let ((x0, y0), (x1, y1)) = (knots[after - 1], knots[after]);
            (y0 + (y1 - y0) * (intensity - x0) / (x1 - x0)).round() as u8
        };
        Self::To(Box::new(std::array::from_fn(|intensity| value(intensity as f32))))
    }

    /// Changes the intensities of a sweep.
    pub fn apply(&self, image: &mut PolarImage) {
        match self {
            Self::Unchanged => {}
            Self::Unknown => image.has_intensity = false,
            Self::To(values) => {
                for pixel in &mut image.pixels {
                    pixel.intensity = values[usize::from(pixel.intensity)];
                }
            }
        }
    }
}

/// Whether a median could be that of a training drive.
fn is_on_scale(found: &GroundIntensities, trained: &GroundIntensities) -> bool {
    let [found, trained] = [found, trained].map(|quantiles| f32::from(quantiles[N / 2]));
    found <= trained * TOLERANCE && found * TOLERANCE >= trained
}
