//! Calibration of the scores: does a score equal the probability of a correct class?

use std::fmt;

/// The points of one bin.
#[derive(Clone, Copy, Default)]
struct Bin {
    n: f64,
    scores: f64,
    correct: f64,
}

/// A reliability diagram: scores and correct classes in ten bins of the score.
#[derive(Clone, Default)]
pub struct Reliability {
    bins: [Bin; 10],
}

impl Reliability {
    /// Adds a point: its score, 0 to 1, and whether its class is correct.
    pub fn add(&mut self, score: f64, is_correct: bool) {
        let bin = &mut self.bins[((score * 10.0) as usize).min(9)];
        bin.n += 1.0;
        bin.scores += score;
        bin.correct += f64::from(u8::from(is_correct));
    }
    /// Adds the points of another diagram.
    pub fn merge(&mut self, other: &Self) {
        for (bin, other) in self.bins.iter_mut().zip(&other.bins) {
            *bin = Bin { n: bin.n + other.n, scores: bin.scores + other.scores, correct: bin.correct + other.correct };
        }
    }
    /// Expected calibration error: mean difference between score and share of correct classes, weighted by points (Guo et al. 2017).
    pub fn calibration_error(&self) -> f64 {
        let n: f64 = self.bins.iter().map(|bin| bin.n).sum();
        self.bins.iter().map(|bin| (bin.scores - bin.correct).abs()).sum::<f64>() / n.max(1.0)
    }
}

/// A Markdown table of the bins with points.
impl fmt::Display for Reliability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| score | points | mean score | correct |\n|---|---|---|---|")?;
        for (tenth, bin) in self.bins.iter().enumerate().filter(|(_, bin)| bin.n > 0.0) {
            let from = tenth as f64 / 10.0;
            let to = (tenth + 1) as f64 / 10.0;
            let scores = 100.0 * bin.scores / bin.n;
            let correct = 100.0 * bin.correct / bin.n;
            writeln!(f, "| {from:.1} to {to:.1} | {} | {scores:.1} % | {correct:.1} % |", bin.n)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibration_error_weights_bins_by_points() {
        let mut sure = Reliability::default();
        let mut unsure = Reliability::default();
        (0..3).for_each(|i| sure.add(0.95, i < 2));
        unsure.add(0.55, true);
        sure.merge(&unsure);
        assert!((sure.calibration_error() - (3.0 * 0.95 - 2.0 + 0.45) / 4.0).abs() < 1e-12);
        let table = sure.to_string();
        assert!(
            table.ends_with("| 0.5 to 0.6 | 1 | 55.0 % | 100.0 % |\n| 0.9 to 1.0 | 3 | 95.0 % | 66.7 % |\n"),
            "{table}"
        );
    }
}
