//! All measures of the classes of points, counted point by point.

use super::coverage::Coverage;
use super::ranges::{self, OfRange};
use super::reliability::Reliability;
use super::seven;
use messages::{ClassId, ClassRow, GROUND_CLASSES};
use scores::Confusion;

/// Counts of points whose true class is scored.
#[derive(Clone)]
pub struct Tally {
    /// Confusion of the classes of this project; with [`Self::ground_only`], of ground and other.
    pub classes: Confusion,
    /// Confusion of the seven classes.
    pub seven: Confusion,
    /// Calibration of the scores; without points if there are no scores.
    pub reliability: Reliability,
    /// Accuracy by score; without points if there are no scores.
    pub coverage: Coverage,
    /// Counts by range; without points if positions are unknown.
    pub ranges: [OfRange; ranges::NAMES.len()],
    /// Points without a predicted class; not counted with [`Self::ground_only`].
    pub n_unknown: u64,
    ground_only: bool,
}

/// The truth of a point.
#[derive(Clone, Copy)]
pub struct TrueClass {
    /// Class id.
    pub class: u8,
    /// Number among the seven classes; `None` if it is not scored.
    pub seven: Option<usize>,
}

impl TrueClass {
    /// The truth of a point with a class id.
    pub fn from_id(class: u8) -> Self {
        Self { class, seven: seven::from_truth(class) }
    }
}

impl Tally {
    /// A tally without points.
    pub fn new() -> Self {
        Self {
            classes: Confusion::new(ClassId::ALL.len()),
            seven: Confusion::new(seven::NAMES.len()),
            reliability: Reliability::default(),
            coverage: Coverage::default(),
            ranges: std::array::from_fn(|_| OfRange::default()),
            n_unknown: 0,
            ground_only: false,
        }
    }
    /// A tally without points that scores ground against all other classes. Neither the seven classes nor the scores are counted,
    /// because a score belongs to one class.
    pub fn ground_only() -> Self {
        Self { ground_only: true, ..Self::new() }
    }
    /// Adds a point without score and position.
    pub fn add_class(&mut self, truth: TrueClass, predicted: u8) {
        let [true_class, found] = self.merged(truth.class, predicted);
        self.classes.add(true_class, found);
        // Ground against the rest: a point without class is not ground.
        self.n_unknown += u64::from(!self.ground_only && predicted == ClassId::Unlabeled as u8);
        if let Some(truth) = self.scored_seven(truth) {
            self.seven.add(truth, seven::from_prediction(predicted));
        }
    }
    /// Adds a point. A point without class counts with score 0.
    pub fn add(&mut self, truth: TrueClass, predicted: ClassRow, range_m: f32) {
        self.add_class(truth, predicted.class_id);
        let [true_class, found] = self.merged(truth.class, predicted.class_id);
        let seven = self.scored_seven(truth);
        let range = &mut self.ranges[ranges::index_for(range_m)];
        range.classes.add(true_class, found);
        if let Some(truth) = seven {
            range.seven.add(truth, seven::from_prediction(predicted.class_id));
        }
        if !self.ground_only {
            let score = if predicted.class_id == ClassId::Unlabeled as u8 { 0 } else { predicted.score };
            let is_correct = truth.class == predicted.class_id;
            self.reliability.add(f64::from(score) / 255.0, is_correct);
            self.coverage.add(score, is_correct);
        }
    }
    /// Adds the points of another tally.
    pub fn merge(&mut self, other: &Self) {
        self.classes.merge(&other.classes);
        self.seven.merge(&other.seven);
        self.reliability.merge(&other.reliability);
        self.coverage.merge(&other.coverage);
        for (range, other) in self.ranges.iter_mut().zip(&other.ranges) {
            range.classes.merge(&other.classes);
            range.seven.merge(&other.seven);
        }
        self.n_unknown += other.n_unknown;
    }
    /// Expected calibration error, 0 to 1; `None` without scores.
    pub fn calibration_error(&self) -> Option<f64> {
        (!self.coverage.is_empty()).then(|| self.reliability.calibration_error())
    }
    /// The sum of several tallies.
    pub fn sum<'a>(tallies: impl Iterator<Item = &'a Self>) -> Self {
        let mut sum = Self::new();
        tallies.for_each(|tally| sum.merge(tally));
        sum
    }

    /// Row and column of a point in the matrix of the classes.
    fn merged(&self, truth: u8, predicted: u8) -> [usize; 2] {
        let is_ground = |class: u8| GROUND_CLASSES.iter().any(|ground| *ground as u8 == class);
        let of_class = |class: u8| match self.ground_only {
            true if is_ground(class) => ClassId::Ground as usize,
            true => ClassId::Other as usize,
            false => usize::from(class),
        };
        [truth, predicted].map(of_class)
    }
    fn scored_seven(&self, truth: TrueClass) -> Option<usize> {
        truth.seven.filter(|_| !self.ground_only)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::ClassId::{Bridge, Building, Road, RoadLine, Unlabeled, Vegetation, Wall};

    fn tally(ground_only: bool) -> Tally {
        let mut tally = if ground_only { Tally::ground_only() } else { Tally::new() };
        let points = [
            (Road, RoadLine, 255, 5.0),
            (Building, Wall, 204, 15.0),
            (Vegetation, Vegetation, 204, 30.0),
            (Bridge, Unlabeled, 100, 60.0),
        ];
        for (truth, class, score, range_m) in points {
            tally.add(TrueClass::from_id(truth as u8), ClassRow { class_id: class as u8, score }, range_m);
        }
        tally
    }

    #[test]
    fn point_counts_in_all_measures() {
        let tally = Tally::sum([tally(false), tally(false)].iter());
        assert_eq!((tally.classes.n(), tally.classes.overall_accuracy()), (8, Some(0.25)));
        assert_eq!((tally.seven.n(), tally.seven.overall_accuracy()), (8, Some(0.75)));
        assert_eq!(tally.ranges.each_ref().map(|range| range.classes.n()), [2; 4]);
        assert_eq!(tally.ranges[3].seven.count(5, seven::N), 2);
        assert_eq!(tally.n_unknown, 2);
        // Points without class have score 0: a threshold above 0 does not keep them.
        assert_eq!(tally.coverage.kept(0.1).share, 0.75);
        // All points with score 1 are wrong, and half of those with score 0.8.
        let expected = (1.0 + (2.0 * 0.8 - 1.0)) / 4.0;
        assert!((tally.calibration_error().expect("has scores") - expected).abs() < 1e-12);
    }

    #[test]
    fn ground_is_scored_without_scores_and_seven_classes() {
        let tally = tally(true);
        assert_eq!((tally.classes.n(), tally.classes.overall_accuracy()), (4, Some(1.0)));
        assert_eq!((tally.seven.n(), tally.calibration_error(), tally.coverage.is_empty()), (0, None, true));
        assert_eq!((tally.ranges[0].classes.n(), tally.n_unknown), (1, 0));
    }

    #[test]
    fn labels_without_scores_have_no_calibration() {
        let mut tally = Tally::new();
        tally.add_class(TrueClass::from_id(Road as u8), Road as u8);
        assert_eq!((tally.calibration_error(), tally.ranges[0].classes.n()), (None, 0));
        assert_eq!(tally.seven.mean_iou(), Some(1.0));
    }
}
