//! Two models as one: the geometric mean of their probabilities, in which the first counts twice (a product of experts, Hinton 2002).
//!
//! Two networks that see the same points in other ways err at other places: one that nearly excludes a class outweighs one that only
//! prefers it.

use crate::cell_probabilities::best_of;
use crate::ground::SubmapGround;
use crate::segmenter::{CellSegmenter, class_row, write_rows};
use crate::{ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use messages::{ClassId, ClassRow};
use std::path::Path;

/// Added to every probability: no model excludes a class for sure. Votes have steps of 1/255.
const LEAST: f32 = 1e-3;

/// Two models with the same classes.
pub struct Fused {
    models: [Box<dyn CellSegmenter>; 2],
    card: ModelCard,
}

impl Fused {
    /// Both models. The card is that of the first, with a digest of both.
    ///
    /// # Errors
    /// If they have other classes, or the same in another order. `path` is the file of the second.
    pub fn new(
        first: Box<dyn CellSegmenter>,
        second: Box<dyn CellSegmenter>,
        path: &Path,
    ) -> Result<Self, SegmentationError> {
        let names = |model: &dyn CellSegmenter| model.classes().iter().map(|class| class.name()).collect::<Vec<_>>();
        let (found, expected) = (names(&*second), names(&*first));
        if found != expected {
            let reason = format!(
                "the classes {} are not those of the model that it is fused with: {}",
                found.join(", "),
                expected.join(", ")
            );
            return Err(SegmentationError::Card { path: path.into(), reason });
        }
        let digest = first.card().digest ^ second.card().digest.rotate_left(1);
        let card = ModelCard { digest, ..first.card().clone() };
        Ok(Self { models: [first, second], card })
    }
}

/// The factors of a geometric mean from the probabilities of the first and of the second model.
const FACTORS: [fn(f32) -> f32; 2] = [|first| (first + LEAST).powi(2).cbrt(), |second| (second + LEAST).cbrt()];

/// The best class and its share of the products of the factors at a point. A model that cannot classify it has none.
fn fuse(factors: [Option<&[f32]>; 2]) -> Option<(usize, f32)> {
    let n_classes = factors.iter().flatten().next()?.len();
    let mut means = [1.0; ClassId::ALL.len()];
    let means = &mut means[..n_classes];
    for of_model in factors.into_iter().flatten() {
        means.iter_mut().zip(of_model).for_each(|(mean, factor)| *mean *= factor);
    }
    let total: f32 = means.iter().sum();
    best_of(means).map(|(class, mean)| (class, mean / total))
}

impl Segmenter for Fused {
    fn card(&self) -> &ModelCard {
        &self.card
    }
    /// Unseen are the points that neither model can classify; the rest of the report is that of the first.
    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let [first, second] = &self.models;
        let ground = SubmapGround::of(input);
        let (of_first, report) = first.probabilities(input, &ground)?;
        let (of_second, _) = second.probabilities(input, &ground)?;
        // By cells, because many points share one.
        let (of_first, of_second) = (of_first.map(FACTORS[0]), of_second.map(FACTORS[1]));
        let decided = of_first.of_points().zip(of_second.of_points()).map(|(first, second)| fuse([first, second]));
        let rows = decided.map(|found| class_row(found.map(|(class, share)| (first.classes()[class], share))));
        let n_unseen = write_rows(rows, classes);
        first.refinement().of_points(input.points, &ground, first.classes(), classes);
        Ok(Report { n_unseen, ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CellProbabilities;
    use crate::spherical::Refinement;
    use messages::{SubmapHeader, SubmapPoint};
    use std::sync::Arc;

    const ROAD_OR_POLE: [ClassId; 2] = [ClassId::Road, ClassId::Pole];

    /// Gives each point its own cell with probabilities of a list.
    struct Fixed(ModelCard, Vec<ClassId>, [[f32; 2]; 4]);

    impl Segmenter for Fixed {
        fn card(&self) -> &ModelCard {
            &self.0
        }
        fn segment(&self, _: &ModelInput<'_>, _: &mut [ClassRow]) -> Result<Report, SegmentationError> {
            unreachable!("fused models give probabilities")
        }
    }

    impl CellSegmenter for Fixed {
        fn classes(&self) -> &[ClassId] {
            &self.1
        }
        fn refinement(&self) -> Refinement {
            Refinement::NONE
        }
        fn probabilities(
            &self,
            _: &ModelInput<'_>,
            _: &Arc<SubmapGround>,
        ) -> Result<(CellProbabilities, Report), SegmentationError> {
            let of_cells = self.2.concat();
            Ok((CellProbabilities::new(2, of_cells, vec![0, 1, 2, 3]), Report { n_unseen: 9, ..Report::default() }))
        }
    }

    fn model(classes: [ClassId; 2], rows: [[f32; 2]; 4]) -> Box<dyn CellSegmenter> {
        let card = ModelCard { architecture: "fixed".to_owned(), version: 1, digest: 0 };
        Box::new(Fixed(card, classes.to_vec(), rows))
    }

    #[test]
    fn point_takes_class_with_the_largest_geometric_mean() {
        let first = model(ROAD_OR_POLE, [[0.7, 0.3], [0.8, 0.2], [0.0, 0.0], [0.0, 0.0]]);
        let second = model(ROAD_OR_POLE, [[0.4, 0.6], [0.01, 0.99], [0.4, 0.6], [0.0, 0.0]]);
        let fused = Fused::new(first, second, Path::new("second")).expect("the same classes");
        let points = [SubmapPoint::default(); 4];
        let mut classes = [ClassRow::default(); 4];
        let report = fused.segment(&ModelInput::new(&SubmapHeader::default(), &points), &mut classes).expect("runs");
        let share = |of: f32, other: f32| (255.0 * of.cbrt() / (of.cbrt() + other.cbrt())).round() as u8;
        let [road, pole] = [0.701_f32.powi(2) * 0.401, 0.301_f32.powi(2) * 0.601];
        let [road_2, pole_2] = [0.801_f32.powi(2) * 0.011, 0.201_f32.powi(2) * 0.991];
        let expected = [
            (ClassId::Road, share(road, pole)),
            (ClassId::Pole, share(pole_2, road_2)),
            (ClassId::Pole, share(0.601, 0.401)),
            (ClassId::Unlabeled, 0),
        ];
        assert_eq!(classes, expected.map(|(class, score)| ClassRow { class_id: class as u8, score }));
        assert_eq!(report.n_unseen, 1);
    }

    #[test]
    fn models_with_other_classes_are_refused_with_both_lists() {
        let rows = [[0.5, 0.5]; 4];
        let [first, second] = [ROAD_OR_POLE, [ClassId::Pole, ClassId::Road]].map(|classes| model(classes, rows));
        let error = Fused::new(first, second, Path::new("second.safetensors")).err().expect("is refused").to_string();
        assert!(
            error.starts_with("second.safetensors: ") && error.contains("pole, road") && error.contains("road, pole")
        );
    }
}
