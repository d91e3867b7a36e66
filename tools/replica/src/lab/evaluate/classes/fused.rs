//! Two models as one: each point takes the class with the higher score.

use messages::ClassRow;
use segmentation::{ModelCard, ModelInput, Report, SegmentationError, Segmenter};

/// Two models.
pub struct Fused(pub [Box<dyn Segmenter>; 2]);

impl Segmenter for Fused {
    fn card(&self) -> &ModelCard {
        self.0[0].card()
    }
    /// Equal scores leave the class of the first model. The report is that of the first.
    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        let [first, second] = &self.0;
        let report = first.segment(input, classes)?;
        let mut others = vec![ClassRow::default(); classes.len()];
        second.segment(input, &mut others)?;
        for (row, other) in classes.iter_mut().zip(others) {
            if other.score > row.score {
                *row = other;
            }
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{SubmapHeader, SubmapPoint};

    /// Gives every point the rows of a list.
    struct Fixed(ModelCard, [[u8; 2]; 3]);

    impl Segmenter for Fixed {
        fn card(&self) -> &ModelCard {
            &self.0
        }
        fn segment(&self, _: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
            for (row, [class_id, score]) in classes.iter_mut().zip(self.1) {
                *row = ClassRow { class_id, score };
            }
            Ok(Report::default())
        }
    }

    #[test]
    fn point_takes_class_with_the_higher_score() {
        let model = |rows| -> Box<dyn Segmenter> {
            Box::new(Fixed(ModelCard { architecture: "fixed".to_owned(), version: 1, digest: 0 }, rows))
        };
        let fused = Fused([model([[1, 200], [2, 90], [3, 7]]), model([[4, 100], [5, 91], [6, 7]])]);
        let points = [SubmapPoint::default(); 3];
        let mut classes = [ClassRow::default(); 3];
        fused.segment(&ModelInput::new(&SubmapHeader::default(), &points), &mut classes).expect("runs");
        assert_eq!(classes.map(|row| [row.class_id, row.score]), [[1, 200], [5, 91], [3, 7]]);
    }
}
