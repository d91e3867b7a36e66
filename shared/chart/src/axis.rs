//! Axes and their ticks.

/// A range of values.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What they are, with the unit.
    pub label: String,
    /// From and to; values outside are drawn at the rim.
    pub range: [f64; 2],
    /// Whether numbers stand beside it.
    pub has_numbers: bool,
}

impl Axis {
    /// With numbers.
    pub fn new(label: impl Into<String>, range: [f64; 2]) -> Self {
        Self { label: label.into(), range, has_numbers: true }
    }
    /// Without numbers: only proportions matter.
    pub fn without_numbers(label: impl Into<String>, range: [f64; 2]) -> Self {
        Self { has_numbers: false, ..Self::new(label, range) }
    }
    /// From 0 to a little above the largest finite value.
    pub fn from_zero(label: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let top = values.into_iter().filter(|value| value.is_finite()).fold(0.0, f64::max);
        Self::new(label, [0.0, if top > 0.0 { 1.05 * top } else { 1.0 }])
    }
    /// Where a value lies: 0 at the begin of the range, 1 at its end, never beyond them.
    pub(crate) fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        if high > low { (value.clamp(low, high) - low) / (high - low) } else { 0.5 }
    }
    /// Round numbers within the range: 1, 2 or 5 of a power of ten apart, for about `n` at most.
    pub(crate) fn ticks(&self, n: f64) -> Vec<f64> {
        let [low, high] = self.range;
        let rough = (high - low) / n.max(1.0);
        if !(rough > 0.0 && rough.is_finite()) {
            return vec![low];
        }
        let power = 10.0_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| *step >= rough).unwrap_or(rough);
        let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        // Multiples of 0.1 have odd last digits otherwise.
        let digits = 10.0_f64.powi(2 - power.log10().round() as i32);
        (first..=last).map(|k| (k as f64 * step * digits).round() / digits).collect()
    }
}

/// A little more than all finite values take; at least 1 wide.
pub(crate) fn range(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let finite = values.filter(|value| value.is_finite());
    let low = finite.clone().fold(f64::INFINITY, f64::min);
    let high = finite.fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return [0.0, 1.0];
    }
    let more = (0.04 * (high - low)).max(0.5);
    [low - more, high + more]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let ticks = |range, n| Axis::new("", range).ticks(n);
        assert_eq!(ticks([0.0, 1.0], 8.0), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(ticks([465.0, 640.0], 8.0), [500.0, 550.0, 600.0]);
        assert_eq!(ticks([-3e-9, 3e-9], 4.0), [-2e-9, 0.0, 2e-9]);
        assert_eq!(ticks([2.0, 2.0], 4.0), [2.0]);
    }

    #[test]
    fn values_outside_lie_at_the_rim() {
        let axis = Axis::new("", [10.0, 20.0]);
        assert_eq!([5.0, 10.0, 12.5, 99.0].map(|value| axis.share(value)), [0.0, 0.0, 0.25, 1.0]);
        assert_eq!(Axis::from_zero("", [f64::NAN, 2.0]).range, [0.0, 2.1]);
    }
}
