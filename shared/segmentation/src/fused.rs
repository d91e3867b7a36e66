//! Two models as one: the weighted geometric mean of their probabilities (a product of experts, Hinton 2002).
//!
//! Two networks that see the same points in other ways err at other places: one that nearly excludes a class outweighs one that only
//! prefers it.

use crate::cell_probabilities::best_of;
use crate::ground::{self, SubmapGround};
use crate::model_file::{CardText, ModelFile, encode_model};
use crate::points::{self, PointModel};
use crate::segmenter::{CellSegmenter, class_row, write_rows};
use crate::settings_rules::check_rules;
use crate::spherical::{self, GroundUse, Options, SphericalModel};
use crate::{ComputeDevice, ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use messages::{ClassId, ClassRow};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Added to every probability: no model excludes a class for sure. Votes have steps of 1/255.
const LEAST: f32 = 1e-3;

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "fused";

/// Version that this program writes and runs.
const VERSION: u32 = 1;

/// Settings of a model file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    /// The first model sees one of this many sweeps of those that it would see alone.
    every: usize,
    /// Share of the first model in the mean, 0 to 1.
    share: f64,
    /// The cards of both models.
    models: [CardText; 2],
}

/// The models of a file of this architecture.
pub(crate) fn parts(file: &ModelFile) -> Result<[ModelFile; 2], SegmentationError> {
    let [first, second] = file.settings::<Settings>()?.models;
    Ok([file.part(0, first), file.part(1, second)])
}

/// The bytes of a model file that fuses two. `share` is that of the first model in the mean, 0 to 1. It then sees one of `every` sweeps
/// of those that it would see alone, 1 to 16: most of what the others show, the second model has seen, too. Equal files give equal bytes.
///
/// # Errors
/// If a file cannot be read, one of the models knows no probabilities, removes the ground first or is fused itself, their classes
/// differ, or a number is outside its range.
pub fn fuse(first: &Path, second: &Path, share: f64, every: usize) -> Result<Vec<u8>, SegmentationError> {
    let files = [ModelFile::read(first)?, ModelFile::read(second)?];
    let settings = Settings { every, share, models: files.each_ref().map(ModelFile::card_text) };
    Fused::of_files(&files, &settings, &Options::default())?;
    let mut tensors = BTreeMap::new();
    for (number, file) in files.iter().enumerate() {
        tensors.extend(file.tensors_of_part(number)?);
    }
    let tensors = tensors.iter().map(|(name, tensor)| (name.as_str(), tensor.clone()));
    encode_model(ARCHITECTURE, VERSION, &settings, tensors.collect())
}

/// Sweeps of which the first model sees one, at most.
const MOST_EVERY: usize = 16;

/// A model that can be fused.
fn of_cells(file: &ModelFile, options: &Options) -> Result<Box<dyn CellSegmenter>, SegmentationError> {
    let removes_ground = || -> Result<bool, SegmentationError> {
        Ok(file.settings::<spherical::Settings>()?.ground == GroundUse::Removed)
    };
    let reason = match file.card.architecture.as_str() {
        spherical::ARCHITECTURE if removes_ground()? => "the model removes the ground first",
        spherical::ARCHITECTURE => return Ok(Box::new(SphericalModel::from_file(file)?.with_options(*options)?)),
        points::ARCHITECTURE => {
            // Its operations have no kernels for a GPU; the other model can be there.
            let on_cpu = Options { device: ComputeDevice::Cpu, ..*options };
            return Ok(Box::new(PointModel::from_file(file)?.with_options(on_cpu)?));
        }
        ground::ARCHITECTURE => "the model knows no probabilities",
        ARCHITECTURE => "the model is fused itself",
        other => return Err(SegmentationError::unknown_architecture(file, other)),
    };
    Err(SegmentationError::Card { path: file.path.clone(), reason: format!("{reason}, so it cannot be fused") })
}

/// Two models with the same classes.
pub struct Fused {
    models: [Box<dyn CellSegmenter>; 2],
    /// Shares of the models in the mean.
    shares: [f32; 2],
    card: ModelCard,
}

impl Fused {
    pub(crate) fn from_file(file: &ModelFile, options: &Options) -> Result<Self, SegmentationError> {
        file.expect_version(VERSION)?;
        Ok(Self { card: file.card.clone(), ..Self::of_files(&parts(file)?, &file.settings()?, options)? })
    }
    /// The model of two files, with the card of the first.
    fn of_files(files: &[ModelFile; 2], settings: &Settings, options: &Options) -> Result<Self, SegmentationError> {
        let Settings { every, share, .. } = *settings;
        // False for NaN.
        check_rules([
            ((0.0..=1.0).contains(&share), format!("share = {share}, must be 0 to 1")),
            ((1..=MOST_EVERY).contains(&every), format!("every = {every}, must be 1 to {MOST_EVERY}")),
        ])?;
        let of_first = Options { every: options.every.saturating_mul(every), ..*options };
        let [first, second] = files;
        Self::new([of_cells(first, &of_first)?, of_cells(second, options)?], share as f32, &second.path)
    }
    /// `path` is the file of the second model.
    fn new(models: [Box<dyn CellSegmenter>; 2], share: f32, path: &Path) -> Result<Self, SegmentationError> {
        let [first, second] = &models;
        let names = |model: &dyn CellSegmenter| model.classes().iter().map(|class| class.name()).collect::<Vec<_>>();
        let (found, expected) = (names(&**second), names(&**first));
        if found != expected {
            let reason = format!(
                "the classes {} are not those of the model that it is fused with: {}",
                found.join(", "),
                expected.join(", ")
            );
            return Err(SegmentationError::Card { path: path.into(), reason });
        }
        let card = first.card().clone();
        Ok(Self { models, shares: [share, 1.0 - share], card })
    }
}

/// The best class and its share of the products of the factors at a point. A model that cannot classify it has none.
fn decide(factors: [Option<&[f32]>; 2]) -> Option<(usize, f32)> {
    let n_classes = factors.iter().flatten().next()?.len();
    let mut means = [1.0; ClassId::ALL.len()];
    let means = &mut means[..n_classes];
    for of_model in factors.into_iter().flatten() {
        means.iter_mut().zip(of_model).for_each(|(mean, factor)| *mean *= factor);
    }
    let total: f32 = means.iter().sum();
    best_of(means).map(|(class, mean)| (class, mean / total))
}

/// Whether both are the row of one cell.
fn is_same(a: Option<&[f32]>, b: Option<&[f32]>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => std::ptr::eq(a, b),
        (a, b) => a.is_none() && b.is_none(),
    }
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
        let [of_first, of_second] = [(of_first, self.shares[0]), (of_second, self.shares[1])]
            .map(|(cells, share)| cells.map(|probability| (probability + LEAST).powf(share)));
        let decided = |factors: [Option<&[f32]>; 2]| {
            class_row(decide(factors).map(|(class, share)| (first.classes()[class], share)))
        };
        // Points that follow each other often share their cells.
        let mut last = ([None, None], decided([None, None]));
        let rows = of_first.of_points().zip(of_second.of_points()).map(|(first, second)| {
            let factors = [first, second];
            if !(0..2).all(|model| is_same(factors[model], last.0[model])) {
                last = (factors, decided(factors));
            }
            last.1
        });
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
        let second = model(ROAD_OR_POLE, [[0.4, 0.6], [0.001, 0.998], [0.4, 0.6], [0.0, 0.0]]);
        let fused = Fused::new([first, second], 0.75, Path::new("second")).expect("the same classes");
        let points = [SubmapPoint::default(); 4];
        let mut classes = [ClassRow::default(); 4];
        let report = fused.segment(&ModelInput::new(&SubmapHeader::default(), &points), &mut classes).expect("runs");
        let share = |of: f32, other: f32| (255.0 * of.powf(0.25) / (of.powf(0.25) + other.powf(0.25))).round() as u8;
        let [road, pole] = [0.701_f32.powi(3) * 0.401, 0.301_f32.powi(3) * 0.601];
        let [road_2, pole_2] = [0.801_f32.powi(3) * 0.002, 0.201_f32.powi(3) * 0.999];
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
        let models = [ROAD_OR_POLE, [ClassId::Pole, ClassId::Road]].map(|classes| model(classes, rows));
        let error = Fused::new(models, 0.5, Path::new("second.safetensors")).err().expect("is refused").to_string();
        assert!(
            error.starts_with("second.safetensors: ") && error.contains("pole, road") && error.contains("road, pole")
        );
    }
}
