//! Durations in logarithmic buckets: percentiles within 9 %, in constant memory.

/// Buckets per factor of two.
const PER_OCTAVE: u32 = 8;
/// Number of octaves. 2^40 ns are 18 minutes: longer steps share the last bucket.
const OCTAVES: u32 = 40;

/// Counts durations.
pub struct Histogram {
    buckets: Vec<u64>,
    count: u64,
    sum_nanos: u64,
    max_nanos: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { buckets: vec![0; (PER_OCTAVE * OCTAVES) as usize], count: 0, sum_nanos: 0, max_nanos: 0 }
    }
}

impl Histogram {
    /// Adds one duration.
    pub fn add(&mut self, nanos: u64) {
        let bucket = ((nanos.max(1) as f64).log2() * f64::from(PER_OCTAVE)) as usize;
        let last = self.buckets.len() - 1;
        self.buckets[bucket.min(last)] += 1;
        self.count += 1;
        self.sum_nanos = self.sum_nanos.saturating_add(nanos);
        self.max_nanos = self.max_nanos.max(nanos);
    }
    /// The duration in ms below which the share `share` of all durations lies; upper edge of its bucket. 0 without
    /// durations.
    pub fn percentile_ms(&self, share: f64) -> f64 {
        let rank = (share * self.count as f64).ceil() as u64;
        let mut seen = 0;
        for (bucket, n) in self.buckets.iter().enumerate() {
            seen += n;
            if seen >= rank && seen > 0 {
                let edge = 2_f64.powf((bucket + 1) as f64 / f64::from(PER_OCTAVE));
                return edge.min(self.max_nanos as f64) * 1e-6;
            }
        }
        0.0
    }
    /// Mean duration, ms. 0 without durations.
    pub fn mean_ms(&self) -> f64 {
        if self.count > 0 { self.sum_nanos as f64 / self.count as f64 * 1e-6 } else { 0.0 }
    }
    /// Longest duration, ms.
    pub fn max_ms(&self) -> f64 {
        self.max_nanos as f64 * 1e-6
    }
    /// Number of durations.
    pub fn count(&self) -> u64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_within_a_bucket() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.percentile_ms(0.5), 0.0);
        for ms in 1..=1000 {
            histogram.add(ms * 1_000_000);
        }
        for (share, truth) in [(0.5, 500.0), (0.99, 990.0), (0.01, 10.0)] {
            let ratio = histogram.percentile_ms(share) / truth;
            assert!((1.0..1.1).contains(&ratio), "{share}: {ratio}");
        }
        assert_eq!((histogram.mean_ms(), histogram.max_ms()), (500.5, 1000.0));
    }
}
