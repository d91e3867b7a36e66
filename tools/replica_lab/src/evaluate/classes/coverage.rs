//! Coverage and accuracy: the share of points above a threshold of the score, and the share of them that is correct.

/// Thresholds of the table.
pub const THRESHOLDS: [f64; 9] = [0.0, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99];

/// Points and correct points by score.
#[derive(Clone)]
pub struct Coverage {
    /// Number of points with a score of i / 255, and of the correct ones.
    by_score: [[u64; 2]; 256],
}

/// The points with at least a score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// Share of all points.
    pub share: f64,
    /// The correct share of these points; `None` without points.
    pub accuracy: Option<f64>,
}

impl Default for Coverage {
    fn default() -> Self {
        Self { by_score: [[0; 2]; 256] }
    }
}

impl Coverage {
    /// Adds a point.
    pub fn add(&mut self, score: u8, is_correct: bool) {
        let [n, n_correct] = &mut self.by_score[usize::from(score)];
        *n += 1;
        *n_correct += u64::from(is_correct);
    }
    /// Adds the points of another curve.
    pub fn merge(&mut self, other: &Self) {
        for (sum, n) in self.by_score.iter_mut().flatten().zip(other.by_score.iter().flatten()) {
            *sum += n;
        }
    }
    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.kept(0.0).accuracy.is_none()
    }
    /// The points with a score of at least `threshold`, 0 to 1.
    pub fn kept(&self, threshold: f64) -> Kept {
        let mut sums = [[0; 2]; 2];
        for (score, counts) in (0_u8..=255).zip(&self.by_score) {
            let is_kept = usize::from(f64::from(score) / 255.0 >= threshold);
            sums[is_kept].iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
        }
        let [[n_rest, _], [n, n_correct]] = sums;
        let accuracy = (n > 0).then(|| n_correct as f64 / n as f64);
        Kept { share: n as f64 / ((n + n_rest) as f64).max(1.0), accuracy }
    }
    /// Share of kept points and their accuracy, by falling threshold.
    pub fn curve(&self) -> Vec<[f64; 2]> {
        let total: u64 = self.by_score.iter().map(|[n, _]| n).sum();
        let mut n_kept = 0;
        let mut n_correct = 0;
        let mut curve = Vec::new();
        for [n, correct] in self.by_score.iter().rev().filter(|[n, _]| *n > 0) {
            n_kept += n;
            n_correct += correct;
            curve.push([n_kept as f64 / total as f64, n_correct as f64 / n_kept as f64]);
        }
        curve
    }
    /// Area below the curve, 0 to 1: mean accuracy over all shares of points kept (Geifman and El-Yaniv 2017). Points with equal score
    /// are kept in random order, so the curve is linear between groups.
    pub fn area(&self) -> Option<f64> {
        let curve = self.curve();
        let mut last = [0.0, curve.first()?[1]];
        let mut area = 0.0;
        for [share, accuracy] in curve {
            area += (share - last[0]) * f64::midpoint(accuracy, last[1]);
            last = [share, accuracy];
        }
        Some(area)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two correct points with full score, one of two correct with half the score, one wrong with score 0.
    fn small() -> Coverage {
        let mut coverage = Coverage::default();
        for (score, is_correct) in [(255, true), (255, true), (128, true), (128, false), (0, false)] {
            coverage.add(score, is_correct);
        }
        coverage
    }

    #[test]
    fn threshold_keeps_points_with_its_score_and_above() {
        let coverage = small();
        assert_eq!(coverage.kept(0.0), Kept { share: 1.0, accuracy: Some(0.6) });
        assert_eq!(coverage.kept(128.0 / 255.0), Kept { share: 0.8, accuracy: Some(0.75) });
        assert_eq!(coverage.kept(0.51), Kept { share: 0.4, accuracy: Some(1.0) });
        assert_eq!(Coverage::default().kept(0.5), Kept { share: 0.0, accuracy: None });
    }

    #[test]
    fn area_is_mean_accuracy_over_shares() {
        let mut twice = small();
        twice.merge(&small());
        assert_eq!(twice.curve(), [[0.4, 1.0], [0.8, 0.75], [1.0, 0.6]]);
        let expected = 0.4 * 1.0 + 0.4 * 0.875 + 0.2 * 0.675;
        assert!((twice.area().expect("has points") - expected).abs() < 1e-12);
        assert_eq!(Coverage::default().area(), None);
    }
}
