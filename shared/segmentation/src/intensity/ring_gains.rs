//! Gains of the rings of a LiDAR: the lasers of a unit have different responses, in some models by a factor of two.

use super::ground_histogram::{GroundHistogram, GroundIntensities, N};
use super::map::IntensityMap;

/// With fewer ground points the gain of a ring is unknown.
const MIN_POINTS: u64 = 100;
/// Fewest steps between the 5 and 95 % quantiles of the ground. On the data sets of `street_labels`, RELLIS-3D has two steps, and most
/// of the ground saturates on the Livox Avia: the default model is better without these intensities.
const FEWEST_STEPS: u8 = 3;
/// Largest share of the ground at the end of the scale.
const LARGEST_SATURATED: f64 = 0.1;
/// Largest factor between the ground of a ring and the ground of all rings. It also covers range and incidence.
const LARGEST: f32 = 4.0;

/// The intensities of the ground, ring by ring. Rings with the same number of several LiDARs count as one.
#[derive(Clone, Debug, Default)]
pub struct GroundByRing(Vec<GroundHistogram>);

/// A return of a ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingReturn {
    /// Number of the ring.
    pub ring: usize,
    /// Strength of the return.
    pub intensity: u8,
    /// Height above the ground, m.
    pub height_m: f32,
}

impl GroundByRing {
    /// Counts the returns from the ground.
    pub fn from_returns(returns: impl Iterator<Item = RingReturn>) -> Self {
        let mut rings = Vec::new();
        for RingReturn { ring, intensity, height_m } in returns {
            if rings.len() <= ring {
                rings.resize_with(ring + 1, GroundHistogram::default);
            }
            rings[ring].add(intensity, height_m);
        }
        Self(rings)
    }

    /// Quantiles of all rings; `None` if there are too few points, or all have intensity 0.
    pub fn quantiles(&self) -> Option<GroundIntensities> {
        self.all().quantiles()
    }

    fn all(&self) -> GroundHistogram {
        let mut all = GroundHistogram::default();
        self.0.iter().for_each(|ring| all.join(ring));
        all
    }

    /// Whether nearly the whole ground has one intensity: a constant instead of intensities.
    pub(super) fn is_constant(&self) -> bool {
        self.quantiles().is_some_and(|found| found[0] == found[N - 1])
    }

    /// Whether the ground has too few different intensities: reflectances of 0 to 0.01 that were rounded to whole numbers, which
    /// normalized would be steps of half the range of a road, or a scale that ends on the ground.
    pub(super) fn is_coarse(&self) -> bool {
        let all = self.all();
        all.quantiles()
            .is_some_and(|found| found[N - 1] - found[0] < FEWEST_STEPS || all.share_of_largest() > LARGEST_SATURATED)
    }

    /// Factor of each ring relative to the median of all rings.
    fn factors(&self) -> Option<Vec<f32>> {
        let median_of_all = f32::from(self.quantiles()?[N / 2]);
        let factor = |ring: &GroundHistogram| match median(ring) {
            Some(median) if median > 0.0 && median_of_all > 0.0 => {
                (median_of_all / median).clamp(1.0 / LARGEST, LARGEST)
            }
            _ => 1.0,
        };
        Some(self.0.iter().map(factor).collect())
    }

    /// Conversion that scales all rings to the same median, and their intensities to the scale of the training data:
    /// linear between the quantiles, proportional above the last one. The result does not depend on the gain of the
    /// sensor. A constant gives no information. `None` if the ground is unknown.
    pub fn normalizing(&self, trained: GroundIntensities) -> Option<IntensityMap> {
        let factors = self.factors()?;
        if self.is_constant() {
            return Some(IntensityMap::Unknown);
        }
        let mut balanced = GroundHistogram::default();
        for (ring, factor) in self.0.iter().zip(&factors) {
            for (intensity, n) in (0_u8..=255).zip(ring.counts()) {
                balanced.add_counts((factor * f32::from(intensity)).round().min(255.0) as u8, *n);
            }
        }
        let value = between(balanced.quantiles()?, trained);
        let map = |factor: &f32| std::array::from_fn(|intensity| value((factor * intensity as f32).min(255.0)));
        Some(IntensityMap::ByRing(factors.iter().map(map).collect()))
    }
}

/// Median of the ground of a ring.
fn median(ring: &GroundHistogram) -> Option<f32> {
    let total: u64 = ring.counts().iter().sum();
    let mut sum = 0;
    let reached = |n: &u64| {
        sum += n;
        2 * sum > total
    };
    ring.counts().iter().position(reached).filter(|_| total >= MIN_POINTS).map(|intensity| intensity as f32)
}

/// The training value for an intensity: linear between quantiles of the ground, and proportional above the last one. Foliage and
/// facades are brighter than most of the ground, so a steeper line, such as one to the end of both scales, would make signs of them.
fn between(found: GroundIntensities, trained: GroundIntensities) -> impl Fn(f32) -> u8 {
    /// An intensity, and the training value for it.
    struct Knot {
        from: f32,
        to: f32,
    }
    let mut knots = vec![Knot { from: 0.0, to: 0.0 }];
    for (number, (from, to)) in found.into_iter().zip(trained).enumerate() {
        let knot = Knot { from: f32::from(from), to: f32::from(to) };
        match knots.last_mut() {
            // Equal quantiles of a coarse scale are one knot, the one nearest to the median.
            Some(last) if knot.from <= last.from && knot.from > 0.0 && number <= N / 2 => last.to = knot.to,
            Some(last) if knot.from <= last.from => {}
            _ => knots.push(knot),
        }
    }
    move |intensity| {
        let last = &knots[knots.len() - 1];
        if intensity >= last.from {
            // A ground of zeros gives no scale.
            let gain = if last.from > 0.0 { last.to / last.from } else { 1.0 };
            return (gain * intensity).round().min(255.0) as u8;
        }
        let after = knots.iter().position(|knot| knot.from >= intensity).unwrap_or(knots.len() - 1).max(1);
        let below = &knots[after - 1];
        let above = &knots[after];
        (below.to + (above.to - below.to) * (intensity - below.from) / (above.from - below.from)).round() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAINED: GroundIntensities = [6, 10, 12, 14, 30];

    #[test]
    fn median_of_a_coarse_scale_is_that_of_the_training() {
        let value = between([1, 1, 1, 2, 2], TRAINED);
        assert_eq!([0.0, 1.0, 2.0].map(value), [0, 12, 14]);
        assert_eq!([0.0, 1.0].map(between([0, 0, 0, 1, 1], TRAINED)), [0, 14]);
    }

    #[test]
    fn intensities_above_the_ground_keep_their_ratio_to_it_for_every_gain() {
        for gain in [0.5, 1.0, 3.0] {
            let found = TRAINED.map(|intensity| (gain * f32::from(intensity)) as u8);
            let value = between(found, TRAINED);
            // Foliage twice as bright as the brightest ground.
            assert_eq!([30.0, 60.0].map(|intensity| value(gain * intensity)), [30, 60], "gain {gain}");
        }
        assert_eq!(between([0; 5], TRAINED)(7.0), 7);
    }

    #[test]
    fn rings_of_other_gains_get_the_same_ground() {
        let ground = |ring, intensity| RingReturn { ring, intensity, height_m: 0.0 };
        let of_ring = |ring: usize| [10_u8, 18, 20, 22, 40].map(|intensity| ground(ring, intensity * (1 + ring as u8)));
        let points = (0..4).flat_map(|ring| of_ring(ring).into_iter().cycle().take(1000));
        let counted = GroundByRing::from_returns(
            points.chain([RingReturn { ring: 9, intensity: 7, height_m: 3.0 }, ground(5, 200)]),
        );
        let map = counted.normalizing(TRAINED).expect("ground");
        for ring in 0..4 {
            let median = 20 * (1 + ring as u8);
            assert!(map.apply(ring, median).abs_diff(12) <= 1, "ring {ring}");
            assert!(map.apply(ring, 2 * median) >= 25, "paint of ring {ring}");
        }
        // Without ground, rings keep their gain; rings that were not counted use the last one.
        let high = map.apply(9, 50);
        assert!(high == map.apply(5, 50) && high == map.apply(200, 50));
        let equal = GroundByRing::from_returns((0..5000).map(|_| ground(0, 76)));
        assert_eq!(equal.normalizing(TRAINED), Some(IntensityMap::Unknown));
        let few = GroundByRing::from_returns((0..1999).map(|_| ground(0, 10)));
        assert!(few.normalizing(TRAINED).is_none());
    }
}
