//! Two models as one: each point takes the class with the higher score.

use crate::{ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use messages::{ClassId, ClassRow};

/// Two models.
pub struct Fused {
    models: [Box<dyn Segmenter>; 2],
    card: ModelCard,
}

impl Fused {
    /// Both models. The card is that of the first, with a digest of both.
    pub fn new(first: Box<dyn Segmenter>, second: Box<dyn Segmenter>) -> Self {
        let digest = first.card().digest ^ second.card().digest.rotate_left(1);
        let card = ModelCard { digest, ..first.card().clone() };
        Self { models: [first, second], card }
    }
}

impl Segmenter for Fused {
    fn card(&self) -> &ModelCard {
        &self.card
    }
    /// Equal scores leave the class of the first model. Unseen are the points that neither model can classify; the rest of the report is that
    /// of the first.
    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        let [first, second] = &self.models;
        let report = first.segment(input, classes)?;
        let mut others = vec![ClassRow::default(); classes.len()];
        second.segment(input, &mut others)?;
        let mut n_unseen = 0;
        for (row, other) in classes.iter_mut().zip(others) {
            if other.score > row.score {
                *row = other;
            }
            n_unseen += usize::from(row.class_id == ClassId::Unlabeled as u8);
        }
        Ok(Report { n_unseen, ..report })
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
        let fused = Fused::new(model([[1, 200], [2, 90], [0, 0]]), model([[4, 100], [5, 91], [0, 0]]));
        let points = [SubmapPoint::default(); 3];
        let mut classes = [ClassRow::default(); 3];
        let report = fused.segment(&ModelInput::new(&SubmapHeader::default(), &points), &mut classes).expect("runs");
        assert_eq!(classes.map(|row| [row.class_id, row.score]), [[1, 200], [5, 91], [0, 0]]);
        assert_eq!(report.n_unseen, 1);
    }
}
