//! The median of few measurements and the interval in which it lies, whatever their distribution.

use serde::Serialize;

/// Probability with which an interval contains the median, if there are enough values.
const CONFIDENCE: f64 = 0.95;

/// A median and its interval between two of the values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Median; the mean of the middle two for an even number of values.
    pub median: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// The interval of the median by order statistics: the narrowest one that contains it with a probability of 95 %. Fewer than six values
    /// do not suffice for that; then the interval is their range (75 % for three values, 94 % for five). No values give zeros.
    pub fn from_values(mut values: Vec<f64>) -> Self {
        values.sort_unstable_by(f64::total_cmp);
        let n = values.len();
        if n == 0 {
            return Self { median: 0.0, low: 0.0, high: 0.0 };
        }
        let cut = values_outside(n);
        Self { median: values[(n - 1) / 2].midpoint(values[n / 2]), low: values[cut], high: values[n - 1 - cut] }
    }

    /// Difference of the ends.
    pub fn width(&self) -> f64 {
        self.high - self.low
    }
}

/// How many of `n` sorted values are outside of the interval on each side.
///
/// The median is below the value of rank k with the probability that at most k of n fair coins show heads.
fn values_outside(n: usize) -> usize {
    // Probability that exactly k of n coins show heads, then of at most k.
    let mut exactly = 0.5_f64.powi(i32::try_from(n).unwrap_or(i32::MAX));
    let mut at_most = exactly;
    let mut cut = 0;
    while cut + 1 < n / 2 {
        exactly *= (n - cut) as f64 / (cut + 1) as f64;
        at_most += exactly;
        if 1.0 - 2.0 * at_most < CONFIDENCE {
            break;
        }
        cut += 1;
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interval_of_few_values_is_their_range_and_of_many_leaves_outliers_out() {
        let interval = Interval::from_values(vec![3.0, 1.0, 2.0]);
        assert_eq!(interval, Interval { median: 2.0, low: 1.0, high: 3.0 });
        // Ranks by the table of the binomial distribution: 9 values leave out 1 on each side, 20 values leave out 5.
        assert_eq!([5, 8, 9, 11, 12, 20].map(values_outside), [0, 0, 1, 1, 2, 5]);
        let with_outlier = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 900.0].to_vec();
        assert_eq!(Interval::from_values(with_outlier), Interval { median: 5.0, low: 2.0, high: 8.0 });
        assert_eq!(Interval::from_values(vec![1.0, 2.0, 4.0, 9.0]).median, 3.0);
    }
}
