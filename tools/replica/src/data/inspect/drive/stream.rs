//! The messages of one sensor over time.

use geometry::Stamp;

/// Gaps that are listed with their times.
const MAX_LISTED: usize = 10;
/// A gap is longer than this many periods.
const GAP_PERIODS: f64 = 3.0;
/// Bins of the rate over time.
const BINS: usize = 60;

/// Seconds between two stamps, which may be any numbers: names of files are stamps.
pub fn seconds_between(later: Stamp, earlier: Stamp) -> f64 {
    later.0.saturating_sub(earlier.0) as f64 * 1e-9
}

/// Number, rate and gaps of the messages of a sensor.
pub struct Stream {
    /// For example `camera 0 (front)`.
    pub name: String,
    /// Model or file format.
    pub kind: String,
    pub n_files: usize,
    pub n_bytes: u64,
    /// Stamps that were read, sorted, ns.
    stamps: Vec<i64>,
    /// End, if not all stamps were read.
    end: Option<i64>,
    /// Least length of a gap, ns.
    min_gap_nanos: i64,
    /// Whether start and end of the other sensors are compared with this one.
    pub is_reference: bool,
}

/// A time without messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Stamp of the message before it.
    pub begin: Stamp,
    pub seconds: f64,
}

/// Gaps of a stream.
pub struct Gaps {
    pub n: usize,
    pub longest: Option<Gap>,
    /// The first gaps.
    pub listed: Vec<Gap>,
}

impl Stream {
    /// A stream whose stamps are all known.
    pub fn new(name: impl Into<String>, kind: impl Into<String>, mut stamps: Vec<i64>) -> Self {
        stamps.sort_unstable();
        Self {
            name: name.into(),
            kind: kind.into(),
            n_files: 0,
            n_bytes: 0,
            stamps,
            end: None,
            min_gap_nanos: 0,
            is_reference: false,
        }
    }
    /// Stream with the number and size of the files that contain it.
    pub fn with_files(self, n_files: usize, n_bytes: u64) -> Self {
        Self { n_files, n_bytes, ..self }
    }
    /// Stream whose gaps are at least this long, ns.
    pub fn with_min_gap(self, min_gap_nanos: i64) -> Self {
        Self { min_gap_nanos, ..self }
    }
    /// Stream of which only the start was read, with its end. `None`: all was read.
    pub fn with_end(self, end: Option<i64>) -> Self {
        Self { end, ..self }
    }
    /// Stream with which the others are compared.
    pub fn into_reference(self) -> Self {
        Self { is_reference: true, ..self }
    }
    /// Messages that were read.
    pub fn len(&self) -> usize {
        self.stamps.len()
    }
    /// Whether the stream continues after the stamps that were read.
    pub fn is_partial(&self) -> bool {
        self.end.is_some()
    }
    /// Stamps of the first and of the last message.
    pub fn span(&self) -> Option<[Stamp; 2]> {
        let first = *self.stamps.first()?;
        let last = *self.stamps.last()?;
        Some([Stamp(first), Stamp(self.end.unwrap_or(last).max(last))])
    }
    /// Median time between two messages, s.
    pub fn period_s(&self) -> Option<f64> {
        let mut steps: Vec<i64> = self.steps().map(|(_, step)| step).collect();
        let middle = steps.len() / 2;
        if steps.is_empty() {
            return None;
        }
        let (_, median, _) = steps.select_nth_unstable(middle);
        Some(*median as f64 * 1e-9)
    }
    /// Median rate, Hz.
    pub fn rate_hz(&self) -> Option<f64> {
        self.period_s().filter(|period_s| *period_s > 0.0).map(|period_s| 1.0 / period_s)
    }
    /// 95 % of the times between two messages differ from their median by less than this, s. Gaps are left out.
    pub fn jitter_s(&self) -> Option<f64> {
        let period_s = self.period_s()?;
        let limit = self.gap_limit_s()?;
        let steps = self.steps().map(|(_, step)| step as f64 * 1e-9).filter(|step| *step <= limit);
        let mut off: Vec<f64> = steps.map(|step| (step - period_s).abs()).collect();
        off.sort_by(f64::total_cmp);
        off.get(off.len().saturating_sub(1) * 95 / 100).copied()
    }
    /// Least length of a gap, s.
    pub fn gap_limit_s(&self) -> Option<f64> {
        Some((GAP_PERIODS * self.period_s()?).max(self.min_gap_nanos as f64 * 1e-9))
    }
    pub fn gaps(&self) -> Gaps {
        let mut gaps = Gaps { n: 0, longest: None, listed: Vec::new() };
        let Some(limit) = self.gap_limit_s() else { return gaps };
        for (begin, step) in self.steps() {
            let gap = Gap { begin: Stamp(begin), seconds: step as f64 * 1e-9 };
            if gap.seconds <= limit {
                continue;
            }
            gaps.n += 1;
            if gaps.listed.len() < MAX_LISTED {
                gaps.listed.push(gap);
            }
            if gaps.longest.is_none_or(|longest| longest.seconds < gap.seconds) {
                gaps.longest = Some(gap);
            }
        }
        gaps
    }
    /// Messages per second in equal pieces of time: seconds after `origin`, Hz.
    pub fn rates(&self, origin: Stamp) -> Vec<[f64; 2]> {
        let (Some(first), Some(last)) = (self.stamps.first(), self.stamps.last()) else { return Vec::new() };
        let n_bins = BINS.min(self.stamps.len() / 4);
        let width_s = last.saturating_sub(*first) as f64 * 1e-9 / n_bins.max(1) as f64;
        if n_bins == 0 || width_s <= 0.0 {
            return Vec::new();
        }
        let mut counts = vec![0_u64; n_bins];
        for stamp in &self.stamps {
            let bin = (stamp.saturating_sub(*first) as f64 * 1e-9 / width_s) as usize;
            counts[bin.min(n_bins - 1)] += 1;
        }
        // The last stamp ends a piece and does not start another.
        counts[n_bins - 1] -= 1;
        let begin_s = seconds_between(Stamp(*first), origin);
        let at = |bin: usize| begin_s + (bin as f64 + 0.5) * width_s;
        counts.iter().enumerate().map(|(bin, n)| [at(bin), *n as f64 / width_s]).collect()
    }

    /// Stamps, and the time to the next one, ns.
    fn steps(&self) -> impl Iterator<Item = (i64, i64)> {
        self.stamps.windows(2).map(|pair| (pair[0], pair[1].saturating_sub(pair[0])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_jitter_and_gaps_of_a_stream_are_exact() {
        // Ten per second, one of them 4 ms late, and two missing twice.
        let mut stamps: Vec<i64> = (0..100).map(|k| k * 100_000_000).collect();
        stamps[50] += 4_000_000;
        for at in [80, 30] {
            stamps.drain(at..at + 3);
        }
        let stream = Stream::new("camera 0", "jpg", stamps);
        assert_eq!((stream.len(), stream.rate_hz()), (94, Some(10.0)));
        let gaps = stream.gaps();
        assert_eq!((gaps.n, gaps.listed.len()), (2, 2));
        assert_eq!(gaps.longest, Some(Gap { begin: Stamp(2_900_000_000), seconds: 0.4 }));
        assert!(stream.jitter_s().expect("has one") < 1e-9);
        assert_eq!(stream.span(), Some([Stamp(0), Stamp(9_900_000_000)]));
        let rates = stream.rates(Stamp(0));
        assert!(rates.iter().any(|[_, hz]| *hz < 5.0) && rates.iter().all(|[_, hz]| *hz < 15.0), "{rates:?}");
    }

    #[test]
    fn stream_of_few_or_extreme_stamps_has_no_rate_and_does_not_panic() {
        for stamps in [vec![], vec![5], vec![7, 7], vec![i64::MIN, i64::MAX]] {
            let stream = Stream::new("a", "b", stamps.clone());
            assert!(stream.rate_hz().is_none_or(|hz| hz < 1e-9), "{stamps:?}");
            stream.gaps();
            stream.rates(Stamp(0));
            stream.jitter_s();
        }
    }
}
