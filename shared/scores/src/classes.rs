//! Scores of predicted classes against labels: precision, recall, IoU, mIoU, overall accuracy (thesis tables 6.4 to 6.10),
//! always from one pooled confusion matrix.

use serde::Serialize;
use std::fmt::Write;

/// A confusion matrix: the number of points by labeled and predicted class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Confusion {
    n_classes: usize,
    counts: Vec<u64>,
}

/// Scores of one class, 0 to 1; `None` if the ratio is 0 / 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassScores {
    /// Share of the predicted points that are correct.
    pub precision: Option<f64>,
    /// Share of the labeled points that are predicted.
    pub recall: Option<f64>,
    /// Intersection over union of labeled and predicted points.
    pub iou: Option<f64>,
    /// Labeled points.
    pub n_truth: u64,
    /// Predicted points.
    pub n_predicted: u64,
}

impl Confusion {
    /// A matrix without points.
    pub fn new(n_classes: usize) -> Self {
        Self { n_classes, counts: vec![0; n_classes * n_classes] }
    }
    /// Adds one point.
    ///
    /// # Panics
    /// If a class is not below the number of classes.
    pub fn add(&mut self, truth: usize, predicted: usize) {
        self.add_n(truth, predicted, 1);
    }
    /// Adds `n` points.
    ///
    /// # Panics
    /// If a class is not below the number of classes.
    pub fn add_n(&mut self, truth: usize, predicted: usize, n: u64) {
        assert!(truth < self.n_classes && predicted < self.n_classes, "class {truth} or {predicted}");
        self.counts[truth * self.n_classes + predicted] += n;
    }
    /// Adds another matrix.
    ///
    /// # Panics
    /// If the number of classes differs.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.n_classes, other.n_classes);
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, n)| *sum += n);
    }
    /// A matrix of the same points with labeled and predicted classes mapped by `class_of`.
    #[must_use]
    pub fn merged(&self, class_of: impl Fn(usize) -> usize) -> Self {
        let mut merged = Self::new(self.n_classes);
        for truth in 0..self.n_classes {
            for predicted in 0..self.n_classes {
                merged.counts[class_of(truth) * self.n_classes + class_of(predicted)] += self.count(truth, predicted);
            }
        }
        merged
    }
    /// Number of points of a labeled and a predicted class.
    pub fn count(&self, truth: usize, predicted: usize) -> u64 {
        self.counts[truth * self.n_classes + predicted]
    }
    /// Number of all points.
    pub fn n(&self) -> u64 {
        self.counts.iter().sum()
    }
    /// Scores of one class.
    pub fn class(&self, class: usize) -> ClassScores {
        let n_truth: u64 = (0..self.n_classes).map(|other| self.count(class, other)).sum();
        let n_predicted: u64 = (0..self.n_classes).map(|other| self.count(other, class)).sum();
        let hits = self.count(class, class);
        let share = |n: u64| (n > 0).then(|| hits as f64 / n as f64);
        ClassScores {
            precision: share(n_predicted),
            recall: share(n_truth),
            iou: share(n_truth + n_predicted - hits),
            n_truth,
            n_predicted,
        }
    }
    /// Mean IoU of the labeled classes; `None` without labeled classes.
    pub fn mean_iou(&self) -> Option<f64> {
        let present = (0..self.n_classes).map(|class| self.class(class)).filter(|scores| scores.n_truth > 0);
        let ious: Vec<f64> = present.filter_map(|scores| scores.iou).collect();
        (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64)
    }
    /// Share of correct points; `None` without points.
    pub fn overall_accuracy(&self) -> Option<f64> {
        let hits: u64 = (0..self.n_classes).map(|class| self.count(class, class)).sum();
        (self.n() > 0).then(|| hits as f64 / self.n() as f64)
    }
}

/// Confusion matrices of several clouds, for tables and files.
#[derive(Clone, Debug)]
pub struct ScoreTable {
    /// Names of the classes.
    pub names: Vec<String>,
    /// Name and confusion matrix of each cloud.
    pub clouds: Vec<(String, Confusion)>,
}

#[derive(Serialize)]
struct JsonCloud<'a> {
    cloud: &'a str,
    n_points: u64,
    mean_iou: Option<f64>,
    overall_accuracy: Option<f64>,
    classes: Vec<JsonClass<'a>>,
    /// Rows are truth, columns predictions, in the order of `classes`.
    confusion: Vec<Vec<u64>>,
}

#[derive(Serialize)]
struct JsonClass<'a> {
    class: &'a str,
    #[serde(flatten)]
    scores: ClassScores,
}

impl ScoreTable {
    /// The sum of all clouds.
    pub fn overall(&self) -> Confusion {
        let mut sum = Confusion::new(self.names.len());
        self.clouds.iter().for_each(|(_, confusion)| sum.merge(confusion));
        sum
    }
    fn with_overall(&self) -> Vec<(String, Confusion)> {
        let overall = (self.clouds.len() != 1).then(|| ("overall".to_owned(), self.overall()));
        self.clouds.iter().cloned().chain(overall).collect()
    }
    /// Classes with labeled or predicted points.
    fn occurring<'a>(&'a self, confusion: &'a Confusion) -> impl Iterator<Item = (&'a str, ClassScores)> {
        let scores = self.names.iter().enumerate().map(|(class, name)| (name.as_str(), confusion.class(class)));
        scores.filter(|(_, scores)| scores.n_truth + scores.n_predicted > 0)
    }
    /// One table per cloud and one for the sum, in percent.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        for (name, confusion) in self.with_overall() {
            let _ = writeln!(text, "### {name}\n\n| class | points | P | R | IoU |\n|---|---|---|---|---|");
            for (class, scores) in self.occurring(&confusion) {
                let [p, r, iou] = [scores.precision, scores.recall, scores.iou].map(percent);
                let _ = writeln!(text, "| {class} | {} | {p} | {r} | {iou} |", scores.n_truth);
            }
            let mean = percent(confusion.mean_iou());
            let accuracy = percent(confusion.overall_accuracy());
            let _ = writeln!(text, "| **mIoU** | {} | | | **{mean}** |", confusion.n());
            let _ = writeln!(text, "| **OA** | | | | **{accuracy}** |\n");
        }
        text
    }
    /// One line per cloud and class; shares of 1.
    pub fn csv(&self) -> String {
        let mut text = String::from("cloud,class,n_truth,n_predicted,precision,recall,iou\n");
        let number = |share: Option<f64>| share.map_or_else(String::new, |share| share.to_string());
        for (name, confusion) in self.with_overall() {
            for (class, s) in self.occurring(&confusion) {
                let [p, r, iou] = [s.precision, s.recall, s.iou].map(number);
                let _ = writeln!(text, "{name},{class},{},{},{p},{r},{iou}", s.n_truth, s.n_predicted);
            }
        }
        text
    }
    /// All scores and confusion matrices.
    pub fn json(&self) -> serde_json::Value {
        let clouds = self.with_overall();
        let of_cloud = |(name, confusion): &(String, Confusion)| {
            let scores = self.names.iter().enumerate();
            let cloud = JsonCloud {
                cloud: name,
                n_points: confusion.n(),
                mean_iou: confusion.mean_iou(),
                overall_accuracy: confusion.overall_accuracy(),
                classes: scores.map(|(i, class)| JsonClass { class, scores: confusion.class(i) }).collect(),
                confusion: confusion.counts.chunks(self.names.len().max(1)).map(<[u64]>::to_vec).collect(),
            };
            serde_json::to_value(cloud).expect("numbers and names are JSON")
        };
        serde_json::Value::Array(clouds.iter().map(of_cloud).collect())
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth a a a b b, predicted a a b b c.
    fn small() -> Confusion {
        let mut confusion = Confusion::new(4);
        for (truth, predicted) in [(0, 0), (0, 0), (0, 1), (1, 1), (1, 2)] {
            confusion.add(truth, predicted);
        }
        confusion
    }

    #[test]
    fn scores_match_manual_calculation() {
        let confusion = small();
        let a = confusion.class(0);
        assert_eq!((a.precision, a.recall, a.iou), (Some(1.0), Some(2.0 / 3.0), Some(2.0 / 3.0)));
        let b = confusion.class(1);
        assert_eq!((b.precision, b.recall, b.iou), (Some(0.5), Some(0.5), Some(1.0 / 3.0)));
        let c = confusion.class(2);
        assert_eq!((c.precision, c.recall, c.iou), (Some(0.0), None, Some(0.0)));
        assert_eq!(confusion.class(3).iou, None);
        // Class c is only predicted: it lowers the recall of class b, but does not count as a class with IoU 0.
        assert_eq!(confusion.mean_iou(), Some(f64::midpoint(2.0 / 3.0, 1.0 / 3.0)));
        assert_eq!(confusion.overall_accuracy(), Some(0.6));
        assert_eq!((Confusion::new(3).mean_iou(), Confusion::new(3).overall_accuracy()), (None, None));
    }

    /// Values of `lab/peers/scores.py frozen` (scikit-learn 1.9.1) on the same labels: class 6 is only predicted, class 7
    /// is neither labeled nor predicted.
    #[test]
    fn scores_match_scikit_learn() {
        let mut random = random::Random::for_stream(5, 0);
        let mut confusion = Confusion::new(8);
        for _ in 0..2000 {
            let truth = random.index(6);
            let is_right = random.index(3) > 0;
            confusion.add(truth, if is_right { truth } else { random.index(7) });
        }
        // Precision, recall, IoU; NaN if undefined.
        let expected = [
            [0.747_800_586_510_3, 0.728_571_428_571_4, 0.584_862_385_321_1],
            [0.761_904_761_904_8, 0.687_679_083_094_6, 0.566_037_735_849_1],
            [0.779_720_279_720_3, 0.659_763_313_609_5, 0.556_109_725_685_8],
            [0.723_472_668_810_3, 0.718_849_840_255_6, 0.563_909_774_436_1],
            [0.726_708_074_534_2, 0.731_25, 0.573_529_411_764_7],
            [0.758_308_157_099_7, 0.760_606_060_606_1, 0.612_195_121_951_2],
            [0.0, f64::NAN, 0.0],
            [f64::NAN, f64::NAN, f64::NAN],
        ];
        let near =
            |got: Option<f64>, expected: f64| got.map_or(expected.is_nan(), |got| (got - expected).abs() < 1e-12);
        for (class, figures) in expected.into_iter().enumerate() {
            let scores = confusion.class(class);
            for (got, expected) in [scores.precision, scores.recall, scores.iou].into_iter().zip(figures) {
                assert!(near(got, expected), "{class}: {scores:?}");
            }
        }
        assert!(near(confusion.mean_iou(), 0.576_107_359_168));
        assert!(near(confusion.overall_accuracy(), 0.714));
    }

    #[test]
    fn merged_classes_count_as_one() {
        let merged = small().merged(|class| class.min(1));
        assert_eq!((merged.count(0, 0), merged.count(0, 1), merged.count(1, 1), merged.n()), (2, 1, 2, 5));
    }

    #[test]
    fn overall_scores_pool_points_of_all_clouds() {
        let mut other = Confusion::new(4);
        (0..95).for_each(|_| other.add(0, 0));
        let names = ["a", "b", "c", "d"].map(str::to_owned).to_vec();
        let table = ScoreTable { names, clouds: vec![("one".into(), small()), ("two".into(), other)] };
        assert_eq!(table.overall().overall_accuracy(), Some(0.98));
        assert!(table.markdown().contains("### overall"));
        assert!(table.markdown().contains("| a | 98 | 100.0 % | 99.0 % | 99.0 % |"), "{}", table.markdown());
        assert!(table.csv().contains("one,b,2,2,0.5,0.5,0.3333333333333333\n"), "{}", table.csv());
        assert_eq!(table.json()[2]["confusion"][0][0], 97);
    }
}
