//! Axes and ticks.

/// Label and range of values along one side of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// First and last value. Values outside are drawn at the edge.
    pub range: [f64; 2],
    /// Whether ticks with numbers are drawn.
    pub has_numbers: bool,
}

impl Axis {
    /// An axis with numbers.
    pub fn new(label: impl Into<String>, range: [f64; 2]) -> Self {
        Self { label: label.into(), range, has_numbers: true }
    }
    /// An axis without numbers, where only proportions matter.
    pub fn without_numbers(label: impl Into<String>, range: [f64; 2]) -> Self {
        Self { has_numbers: false, ..Self::new(label, range) }
    }
    /// An axis from 0 to 5 % above the largest finite value.
    pub fn from_zero(label: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let top = values.into_iter().filter(|value| value.is_finite()).fold(0.0, f64::max);
        Self::new(label, [0.0, if top > 0.0 { 1.05 * top } else { 1.0 }])
    }
    /// Relative position of a value: 0 at the first value of the range, 1 at the last, clamped to 0 and 1.
    pub(crate) fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        if high > low { (value.clamp(low, high) - low) / (high - low) } else { 0.5 }
    }
    /// Round numbers within the range, in steps of 1, 2 or 5 times a power of ten, at most about `n`.
    pub(crate) fn ticks(&self, n: f64) -> Vec<f64> {
        let [low, high] = self.range;
        let rough = (high - low) / n.max(1.0);
        if !(rough > 0.0 && rough.is_finite()) {
            return vec![low];
        }
        let power = 10.0_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| *step >= rough).unwrap_or(rough);
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        // Without rounding, multiples of 0.1 would show floating-point digits.
        let digits = 10.0_f64.powi(2 - power.log10().round() as i32);
        (first..=last).map(|k| (k as f64 * step * digits).round() / digits).collect()
    }
}

/// Range of all finite values with a margin; at least 1 wide.
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
    fn ticks_are_round_and_inside_the_range() {
        let ticks = |range, n| Axis::new("", range).ticks(n);
        assert_eq!(ticks([0.0, 1.0], 8.0), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(ticks([465.0, 640.0], 8.0), [500.0, 550.0, 600.0]);
        assert_eq!(ticks([-3e-9, 3e-9], 4.0), [-2e-9, 0.0, 2e-9]);
        assert_eq!(ticks([2.0, 2.0], 4.0), [2.0]);
    }

    #[test]
    fn values_outside_are_clamped_to_the_range() {
        let axis = Axis::new("", [10.0, 20.0]);
        assert_eq!([5.0, 10.0, 12.5, 99.0].map(|value| axis.share(value)), [0.0, 0.0, 0.25, 1.0]);
        assert_eq!(Axis::from_zero("", [f64::NAN, 2.0]).range, [0.0, 2.1]);
    }
}
