//! Points with a low score lose their class.

use crate::{ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use messages::{ClassId, ClassRow};

/// A model whose points with a score below a threshold are [`ClassId::Unlabeled`]. They keep their score.
pub struct UnknownBelow {
    model: Box<dyn Segmenter>,
    threshold: f64,
}

impl UnknownBelow {
    /// Wraps a model of any architecture. The threshold is a score, 0 to 1. A threshold of 0 returns the unchanged
    /// model.
    pub fn wrap(model: Box<dyn Segmenter>, threshold: f64) -> Box<dyn Segmenter> {
        if threshold > 0.0 { Box::new(Self { model, threshold }) } else { model }
    }
}

impl Segmenter for UnknownBelow {
    fn card(&self) -> &ModelCard {
        self.model.card()
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        let report = self.model.segment(input, classes)?;
        let mut n_unknown = 0;
        for row in classes.iter_mut() {
            let has_class = row.class_id != ClassId::Unlabeled as u8;
            if has_class && f64::from(row.score) / 255.0 < self.threshold {
                row.class_id = ClassId::Unlabeled as u8;
                n_unknown += 1;
            }
        }
        Ok(Report { n_unknown: report.n_unknown + n_unknown, ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{SubmapHeader, SubmapPoint};

    /// Assigns a class with rising score to three points, and no class to a fourth.
    struct Fixed(ModelCard);

    const ROWS: [ClassRow; 4] = [
        ClassRow { class_id: ClassId::Road as u8, score: 127 },
        ClassRow { class_id: ClassId::Road as u8, score: 128 },
        ClassRow { class_id: ClassId::Pole as u8, score: 255 },
        ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 },
    ];

    impl Segmenter for Fixed {
        fn card(&self) -> &ModelCard {
            &self.0
        }
        fn segment(&self, _: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
            classes.copy_from_slice(&ROWS);
            Ok(Report { n_unseen: 1, ..Report::default() })
        }
    }

    fn segmented(threshold: f64) -> ([ClassRow; 4], Report) {
        let card = ModelCard { architecture: "fixed".to_owned(), version: 1, digest: 7 };
        let model = UnknownBelow::wrap(Box::new(Fixed(card)), threshold);
        assert_eq!(model.card().digest, 7);
        let points = [SubmapPoint::default(); 4];
        let mut classes = [ClassRow::default(); 4];
        let header = SubmapHeader::default();
        let input = ModelInput::new(&header, &points);
        let report = model.segment(&input, &mut classes).expect("runs");
        (classes, report)
    }

    #[test]
    fn points_below_threshold_lose_class_and_keep_score() {
        let (classes, report) = segmented(0.5);
        let unlabeled = ClassRow { class_id: ClassId::Unlabeled as u8, score: 127 };
        assert_eq!(classes, [unlabeled, ROWS[1], ROWS[2], ROWS[3]]);
        assert_eq!((report.n_unknown, report.n_unseen), (1, 1), "a point without class is not counted twice");
    }

    #[test]
    fn threshold_zero_changes_nothing_and_threshold_one_keeps_certain_points() {
        assert_eq!(segmented(0.0), (ROWS, Report { n_unseen: 1, ..Report::default() }));
        let (classes, report) = segmented(1.0);
        assert_eq!((classes[2], report.n_unknown), (ROWS[2], 2));
    }
}
