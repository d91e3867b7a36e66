//! How far scores are the share of right answers.

use std::fmt;

/// Points of a tenth of the scores.
#[derive(Clone, Copy, Default)]
struct Bin {
    n: f64,
    scores: f64,
    right: f64,
}

/// Scores against right answers, in ten bins of the score.
#[derive(Default)]
pub struct Reliability {
    bins: [Bin; 10],
}

impl Reliability {
    /// Adds a point: its score, 0 to 1, and whether its class is right.
    pub fn add(&mut self, score: f64, is_right: bool) {
        let bin = &mut self.bins[((score * 10.0) as usize).min(9)];
        bin.n += 1.0;
        bin.scores += score;
        bin.right += f64::from(u8::from(is_right));
    }
    /// Adds the points of another.
    pub fn merge(&mut self, other: &Self) {
        for (bin, other) in self.bins.iter_mut().zip(&other.bins) {
            *bin = Bin { n: bin.n + other.n, scores: bin.scores + other.scores, right: bin.right + other.right };
        }
    }
    /// Mean distance of a bin's scores from its share of right answers (Guo et al. 2017).
    pub fn error(&self) -> f64 {
        let n: f64 = self.bins.iter().map(|bin| bin.n).sum();
        self.bins.iter().map(|bin| (bin.scores - bin.right).abs()).sum::<f64>() / n.max(1.0)
    }
}

/// A Markdown table of the bins that have points.
impl fmt::Display for Reliability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| score | points | mean score | right |\n|---|---|---|---|")?;
        for (tenth, bin) in self.bins.iter().enumerate().filter(|(_, bin)| bin.n > 0.0) {
            let (from, to) = (tenth as f64 / 10.0, (tenth + 1) as f64 / 10.0);
            let (scores, right) = (100.0 * bin.scores / bin.n, 100.0 * bin.right / bin.n);
            writeln!(f, "| {from:.1} to {to:.1} | {} | {scores:.1} % | {right:.1} % |", bin.n)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_pooled_and_weighed_by_their_points() {
        let (mut sure, mut unsure) = (Reliability::default(), Reliability::default());
        (0..3).for_each(|i| sure.add(0.95, i < 2));
        unsure.add(0.55, true);
        sure.merge(&unsure);
        assert!((sure.error() - (3.0 * 0.95 - 2.0 + 0.45) / 4.0).abs() < 1e-12);
        let table = sure.to_string();
        assert!(
            table.ends_with("| 0.5 to 0.6 | 1 | 55.0 % | 100.0 % |\n| 0.9 to 1.0 | 3 | 95.0 % | 66.7 % |\n"),
            "{table}"
        );
    }
}
