//! Fusion of two models: the weighted geometric mean of their probabilities (a product of experts, Hinton 2002).
//!
//! Two networks with different views of the points make different errors: a model that nearly excludes a class
//! outweighs a model that only prefers it. A class that both models often miss is therefore missed more often after
//! fusion: its mean is multiplied by a prior above 1 (logit adjustment, Menon et al. 2021). Where two models with
//! different errors agree, they are correct more often than either score indicates: a temperature below 1 raises the
//! scores of the decided classes, and changes no class.

use crate::CellProbabilities;
use crate::cell_probabilities::{BestClass, best_share_of, best_without, row_of};
use crate::class_rows::write_rows;
use crate::driven_path::{DrivenPath, road_factors};
use crate::ground_quasi_flat;
use crate::model_file::{CardText, ModelFile, encode_model};
use crate::options::Options;
use crate::points::{self, PointModel};
use crate::segmenter::CellSegmenter;
use crate::settings_rules::{Rule, check_rules};
use crate::spherical::{self, GroundUse, SphericalModel};
use crate::views::mean_over_views;
use crate::{ComputeDevice, ModelCard, ModelInput, Report, SegmentationError, Segmenter, SubmapProbabilities};
use ground::SubmapGround;
use messages::{ClassId, ClassRow};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Added to every probability, so that no model excludes a class with certainty. Votes have steps of 1/255.
const LEAST: f32 = 1e-3;

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "fused";

/// Version that this program writes and runs.
const VERSION: u32 = 1;

/// Parameters of the fusion.
#[derive(Clone, Debug, PartialEq)]
pub struct Fusion {
    /// Share of the first model in the mean, 0 to 1.
    pub share: f64,
    /// The first model processes one in this many of its sweeps, 1 to 16. Most of what the skipped sweeps show is also
    /// input of the second model.
    pub every: usize,
    /// Factors of the means by class name, 0.01 to 100; 1 for other classes.
    pub priors: BTreeMap<String, f32>,
    /// Divisor of the logarithms of the products of means and priors, 0.1 to 10 (temperature scaling, Guo et al. 2017).
    pub temperature: f32,
}

/// Settings of a model file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    every: usize,
    share: f64,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    priors: BTreeMap<String, f32>,
    #[serde(default = "no_temperature")]
    temperature: f32,
    /// The cards of both models.
    models: [CardText; 2],
}

/// The temperature that leaves scores unchanged.
fn no_temperature() -> f32 {
    1.0
}

/// The models of a file of this architecture.
pub(crate) fn parts(file: &ModelFile) -> Result<[ModelFile; 2], SegmentationError> {
    let [first, second] = file.settings::<Settings>()?.models;
    Ok([file.part(0, first), file.part(1, second)])
}

/// The bytes of a model file that fuses two. Equal files give equal bytes.
///
/// # Errors
/// If a file cannot be read, one of the models has no probabilities, removes the ground first or is itself fused, their
/// classes differ, a prior names another class, or a number is outside its range.
pub fn fuse(first: &Path, second: &Path, fusion: &Fusion) -> Result<Vec<u8>, SegmentationError> {
    let files = [ModelFile::read(first)?, ModelFile::read(second)?];
    Fused::from_files(&files, fusion, &Options::default())?;
    let Fusion { share, every, priors, temperature } = fusion.clone();
    let settings = Settings { every, share, priors, temperature, models: files.each_ref().map(ModelFile::card_text) };
    let mut tensors = BTreeMap::new();
    for (number, file) in files.iter().enumerate() {
        tensors.extend(file.tensors_of_part(number)?);
    }
    let tensors = tensors.iter().map(|(name, tensor)| (name.as_str(), tensor.clone()));
    encode_model(ARCHITECTURE, VERSION, &settings, tensors.collect())
}

/// Largest value of [`Fusion::every`].
const MOST_EVERY: usize = 16;

/// A model that can be fused.
fn cell_segmenter(file: &ModelFile, options: &Options) -> Result<Box<dyn CellSegmenter>, SegmentationError> {
    let removes_ground = || -> Result<bool, SegmentationError> {
        Ok(file.settings::<spherical::Settings>()?.ground == GroundUse::Removed)
    };
    let reason = match file.card.architecture.as_str() {
        spherical::ARCHITECTURE if removes_ground()? => "the model removes the ground first",
        spherical::ARCHITECTURE => return Ok(Box::new(SphericalModel::from_file(file)?.with_options(*options)?)),
        points::ARCHITECTURE => {
            // Its operations have no GPU kernels; the other model can run on the GPU.
            let on_cpu = Options { device: ComputeDevice::Cpu, ..*options };
            return Ok(Box::new(PointModel::from_file(file)?.with_options(on_cpu)?));
        }
        ground_quasi_flat::ARCHITECTURE => "the model has no probabilities",
        ARCHITECTURE => "the model is itself fused",
        _ => return Err(file.unknown_architecture()),
    };
    Err(SegmentationError::Card { path: file.path.clone(), reason: format!("{reason}, so it cannot be fused") })
}

/// Two models with the same classes.
pub struct Fused {
    models: [Box<dyn CellSegmenter>; 2],
    /// Shares of the models in the mean.
    shares: [f32; 2],
    /// Factor of each class, to the power of 1 / temperature.
    priors: Vec<f32>,
    temperature: f32,
    /// Number of views that vote.
    n_views: usize,
    card: ModelCard,
}

impl Fused {
    pub(crate) fn from_file(file: &ModelFile, options: &Options) -> Result<Self, SegmentationError> {
        file.expect_version(VERSION)?;
        let Settings { every, share, priors, temperature, .. } = file.settings()?;
        let fused = Self::from_files(&parts(file)?, &Fusion { share, every, priors, temperature }, options)?;
        Ok(Self { card: file.card.clone(), ..fused })
    }
    /// Reads the files of two models. The result has the card of the first.
    ///
    /// # Errors
    /// The errors of [`fuse`].
    pub fn read(first: &Path, second: &Path, fusion: &Fusion, options: &Options) -> Result<Self, SegmentationError> {
        Self::from_files(&[ModelFile::read(first)?, ModelFile::read(second)?], fusion, options)
    }
    /// The model of two files, with the card of the first.
    fn from_files(files: &[ModelFile; 2], fusion: &Fusion, options: &Options) -> Result<Self, SegmentationError> {
        let Fusion { share, every, .. } = *fusion;
        // False for NaN.
        check_rules([
            Rule::new((0.0..=1.0).contains(&share), format!("share = {share}, must be 0 to 1")),
            Rule::new((1..=MOST_EVERY).contains(&every), format!("every = {every}, must be 1 to {MOST_EVERY}")),
            Rule::for_temperature(fusion.temperature),
        ])?;
        let of_first = Options { every: options.every.saturating_mul(every), ..*options };
        let [first, second] = files;
        let models = [cell_segmenter(first, &of_first)?, cell_segmenter(second, options)?];
        Ok(Self { n_views: options.views, ..Self::new(models, fusion, &second.path)? })
    }
    /// `path` is the file of the second model.
    fn new(models: [Box<dyn CellSegmenter>; 2], fusion: &Fusion, path: &Path) -> Result<Self, SegmentationError> {
        let Fusion { share, ref priors, temperature, .. } = *fusion;
        let [first, second] = &models;
        let names = |model: &dyn CellSegmenter| model.classes().iter().map(|class| class.name()).collect::<Vec<_>>();
        let found = names(&**second);
        let expected = names(&**first);
        if found != expected {
            let reason = format!(
                "the classes {} differ from the classes of the other model: {}",
                found.join(", "),
                expected.join(", ")
            );
            return Err(SegmentationError::Card { path: path.into(), reason });
        }
        for (name, prior) in priors {
            let known = || format!("priors: unknown class {name:?}; known are {}", expected.join(", "));
            check_rules([
                Rule::new(expected.contains(&name.as_str()), known()),
                Rule::new((0.01..=100.0).contains(prior), format!("priors: {name} = {prior}, must be 0.01 to 100")),
            ])?;
        }
        let prior = |name: &&str| priors.get(*name).map_or(1.0, |prior| prior.powf(1.0 / temperature));
        let priors = expected.iter().map(prior).collect();
        let card = first.card().clone();
        let share = share as f32;
        Ok(Self { models, shares: [share, 1.0 - share], priors, temperature, n_views: 1, card })
    }
    /// The classes, in order.
    pub fn classes(&self) -> &[ClassId] {
        self.models[0].classes()
    }
    /// The means of one of `step` points, starting with the first, before priors and temperature: for each point a
    /// value for each class, or zeros if neither model can classify it.
    ///
    /// # Errors
    /// If the columns of the input differ in length, or a model fails.
    ///
    /// # Panics
    /// If `step` is 0.
    pub fn means(&self, input: &ModelInput<'_>, step: usize) -> Result<Vec<f32>, SegmentationError> {
        input.check_columns()?;
        let ground = SubmapGround::find(input.header, input.points);
        let Factors { of_models: [of_first, of_second], .. } = self.factors(input, &ground, self.shares)?;
        let n_classes = self.classes().len();
        let mut means = Vec::with_capacity(input.points.len().div_ceil(step) * n_classes);
        for factors in of_first.per_point().zip(of_second.per_point()).map(<[_; 2]>::from).step_by(step) {
            let known = if factors.iter().any(Option::is_some) { 1.0 } else { 0.0 };
            means.resize(means.len() + n_classes, known);
            let of_point = means.len() - n_classes;
            multiply(&mut means[of_point..], factors);
        }
        Ok(means)
    }
    /// The priors, with the bias of the products below the path divided out.
    fn priors_without_road_bias(
        &self,
        input: &ModelInput<'_>,
        ground: &SubmapGround,
        of_models: [&CellProbabilities; 2],
    ) -> Vec<f32> {
        let Some(path) = DrivenPath::find(input.header) else { return self.priors.clone() };
        let n_classes = self.priors.len();
        let below = path.ground(input.points, &ground.heights_m);
        let rows: Vec<_> =
            below.filter_map(|point| products(&self.priors, of_models.map(|cells| cells.at(point)))).collect();
        match road_factors(rows.iter().map(|row| &row[..n_classes]), self.classes()) {
            Some(factors) => self.priors.iter().zip(factors).map(|(prior, factor)| prior * factor).collect(),
            None => self.priors.clone(),
        }
    }
    /// Factors of each model in the products.
    fn factors(
        &self,
        input: &ModelInput<'_>,
        ground: &Arc<SubmapGround>,
        exponents: [f32; 2],
    ) -> Result<Factors, SegmentationError> {
        let models = self.models.each_ref().map(|model| &**model);
        let [first, second] = mean_over_views(models, self.n_views, input, ground)?;
        let SubmapProbabilities { cells: of_first, report } = first;
        let SubmapProbabilities { cells: of_second, .. } = second;
        // Computed per cell because many points share one.
        let power = |exponent: f32| move |probability: f32| (probability + LEAST).powf(exponent);
        let of_models = [of_first.map(power(exponents[0])), of_second.map(power(exponents[1]))];
        Ok(Factors { of_models, report })
    }
}

/// Factors of both models in the products of a submap.
struct Factors {
    /// The probabilities of each model to the power of its exponent.
    of_models: [CellProbabilities; 2],
    /// The report of the first model.
    report: Report,
}

/// Multiplies values of the classes by the factors at a point. A model that cannot classify the point has no factors.
fn multiply(values: &mut [f32], factors: [Option<&[f32]>; 2]) {
    for of_model in factors.into_iter().flatten() {
        values.iter_mut().zip(of_model).for_each(|(value, factor)| *value *= factor);
    }
}

/// The products of priors and factors at a point; only the first ones, one for each prior, have a meaning. `None` without factors.
fn products(priors: &[f32], factors: [Option<&[f32]>; 2]) -> Option<[f32; ClassId::ALL.len()]> {
    factors.iter().flatten().next()?;
    let mut products = [1.0; ClassId::ALL.len()];
    products[..priors.len()].copy_from_slice(priors);
    multiply(&mut products[..priors.len()], factors);
    Some(products)
}

/// The best class at a point and its share of the products of priors and factors.
fn decide(priors: &[f32], factors: [Option<&[f32]>; 2]) -> Option<BestClass> {
    best_share_of(&products(priors, factors)?[..priors.len()])
}

/// Whether both are the row of the same cell.
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
    /// `n_unseen` counts the points that neither model can classify; the rest of the report is from the first model.
    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let first = &self.models[0];
        let ground = SubmapGround::find(input.header, input.points);
        // A temperature costs nothing because the factors are computed with exponents anyway.
        let exponents = self.shares.map(|share| share / self.temperature);
        let Factors { of_models: [of_first, of_second], report } = self.factors(input, &ground, exponents)?;
        let priors = if first.refinement().driven_is_road {
            self.priors_without_road_bias(input, &ground, [&of_first, &of_second])
        } else {
            self.priors.clone()
        };
        let decided = |factors: [Option<&[f32]>; 2]| row_of(decide(&priors, factors), first.classes());
        // Consecutive points often share their cells.
        let mut last = ([None, None], decided([None, None]));
        let rows = of_first.per_point().zip(of_second.per_point()).map(|(first, second)| {
            let factors = [first, second];
            if !(0..2).all(|model| is_same(factors[model], last.0[model])) {
                last = (factors, decided(factors));
            }
            last.1
        });
        let n_unseen = write_rows(rows, classes);
        let without = |point: usize, class: ClassId| {
            let products = products(&priors, [of_first.at(point), of_second.at(point)]);
            let best = products.and_then(|products| best_without(&products[..priors.len()], class, first.classes()));
            row_of(best, first.classes())
        };
        first.refinement().refine(input.points, &ground, first.classes(), classes, without);
        Ok(Report { n_unseen, ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refinement::Refinement;
    use messages::{SubmapHeader, SubmapPoint};

    const ROAD_OR_POLE: [ClassId; 2] = [ClassId::Road, ClassId::Pole];

    /// Gives each point its own cell with probabilities from a list.
    struct Fixed {
        card: ModelCard,
        classes: Vec<ClassId>,
        rows: [[f32; 2]; 4],
    }

    impl Segmenter for Fixed {
        fn card(&self) -> &ModelCard {
            &self.card
        }
        fn segment(&self, _: &ModelInput<'_>, _: &mut [ClassRow]) -> Result<Report, SegmentationError> {
            unreachable!("fused models give probabilities")
        }
    }

    impl CellSegmenter for Fixed {
        fn classes(&self) -> &[ClassId] {
            &self.classes
        }
        fn refinement(&self) -> Refinement {
            Refinement::NONE
        }
        fn probabilities(
            &self,
            _: &ModelInput<'_>,
            _: &Arc<SubmapGround>,
        ) -> Result<SubmapProbabilities, SegmentationError> {
            let cells = CellProbabilities::new(2, self.rows.concat(), vec![0, 1, 2, 3]);
            Ok(SubmapProbabilities { cells, report: Report { n_unseen: 9, ..Report::default() } })
        }
    }

    fn model(classes: [ClassId; 2], rows: [[f32; 2]; 4]) -> Box<dyn CellSegmenter> {
        let card = ModelCard { architecture: "fixed".to_owned(), version: 1, digest: 0 };
        Box::new(Fixed { card, classes: classes.to_vec(), rows })
    }

    fn fused(
        models: [Box<dyn CellSegmenter>; 2],
        share: f64,
        priors: &[(&str, f32)],
        temperature: f32,
    ) -> Result<Fused, SegmentationError> {
        let priors = priors.iter().map(|(name, prior)| ((*name).to_owned(), *prior)).collect();
        let fusion = Fusion { share, every: 1, priors, temperature };
        Fused::new(models, &fusion, Path::new("second.safetensors"))
    }

    #[test]
    fn point_takes_class_with_the_largest_geometric_mean() {
        let first = model(ROAD_OR_POLE, [[0.7, 0.3], [0.8, 0.2], [0.0, 0.0], [0.0, 0.0]]);
        let second = model(ROAD_OR_POLE, [[0.4, 0.6], [0.001, 0.998], [0.4, 0.6], [0.0, 0.0]]);
        let fused = fused([first, second], 0.75, &[], 1.0).expect("the same classes");
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
        let error = fused(models, 0.5, &[], 1.0).err().expect("is refused").to_string();
        assert!(
            error.starts_with("second.safetensors: ") && error.contains("pole, road") && error.contains("road, pole")
        );
    }

    #[test]
    fn prior_multiplies_the_mean_of_its_class() {
        let rows = [[0.7, 0.3], [0.9, 0.1], [0.4, 0.6], [0.0, 0.0]];
        let models = || [model(ROAD_OR_POLE, rows), model(ROAD_OR_POLE, rows)];
        let input = (SubmapHeader::default(), [SubmapPoint::default(); 4]);
        let input = ModelInput::new(&input.0, &input.1);
        let of_priors = fused(models(), 0.5, &[("pole", 3.0)], 1.0).expect("is one of the classes");
        let mut classes = [ClassRow::default(); 4];
        of_priors.segment(&input, &mut classes).expect("runs");
        let share = |of: f32, other: f32| (255.0 * of / (of + other)).round() as u8;
        let expected = [
            (ClassId::Pole, share(3.0 * 0.301, 0.701)),
            (ClassId::Road, share(0.901, 3.0 * 0.101)),
            (ClassId::Pole, share(3.0 * 0.601, 0.401)),
            (ClassId::Unlabeled, 0),
        ];
        assert_eq!(classes, expected.map(|(class, score)| ClassRow { class_id: class as u8, score }));
        let means = of_priors.means(&input, 1).expect("runs");
        for (priors, temperature) in [(&[][..], 1.0), (&[("pole", 3.0)], 0.5)] {
            let other = fused(models(), 0.5, priors, temperature).expect("suit");
            assert_eq!(means, other.means(&input, 1).expect("runs"), "before priors and temperature");
        }
        let close = |mean: &f32, expected: f32| (mean - expected).abs() < 1e-6;
        assert!(close(&means[0], 0.701) && close(&means[1], 0.301) && means[6..] == [0.0; 2], "{means:?}");
        assert_eq!(of_priors.means(&input, 2).expect("runs"), [&means[..2], &means[4..6]].concat());
    }

    #[test]
    fn temperature_below_one_raises_the_scores_and_keeps_the_classes() {
        let first = [[0.7, 0.3], [0.9, 0.1], [0.4, 0.6], [0.0, 0.0]];
        let second = [[0.6, 0.4], [0.5, 0.5], [0.0, 0.0], [0.0, 0.0]];
        let input = (SubmapHeader::default(), [SubmapPoint::default(); 4]);
        let input = ModelInput::new(&input.0, &input.1);
        let rows = |temperature| {
            let models = [model(ROAD_OR_POLE, first), model(ROAD_OR_POLE, second)];
            let fused = fused(models, 0.5, &[("pole", 1.25)], temperature).expect("suit");
            let mut classes = [ClassRow::default(); 4];
            fused.segment(&input, &mut classes).expect("runs");
            classes
        };
        let share = |of: f32, other: f32| (255.0 * of.powi(2) / (of.powi(2) + other.powi(2))).round() as u8;
        let sqrt_of_products =
            |class: usize, row: usize| ((first[row][class] + LEAST) * (second[row][class] + LEAST)).sqrt();
        let expected = [
            (ClassId::Road, share(sqrt_of_products(0, 0), 1.25 * sqrt_of_products(1, 0))),
            (ClassId::Road, share(sqrt_of_products(0, 1), 1.25 * sqrt_of_products(1, 1))),
            (ClassId::Pole, share(1.25 * 0.601_f32.sqrt(), 0.401_f32.sqrt())),
            (ClassId::Unlabeled, 0),
        ];
        assert_eq!(rows(0.5), expected.map(|(class, score)| ClassRow { class_id: class as u8, score }));
        for (lower, higher) in rows(1.0).iter().zip(rows(0.5)).take(3) {
            assert!(lower.class_id == higher.class_id && lower.score < higher.score, "{lower:?} {higher:?}");
        }
    }

    #[test]
    fn priors_of_other_classes_or_outside_their_range_are_refused() {
        let models = || [(); 2].map(|()| model(ROAD_OR_POLE, [[0.5, 0.5]; 4]));
        let refused = |prior| fused(models(), 0.5, &[prior], 1.0).err().expect("is refused").to_string();
        assert!(refused(("poles", 2.0)).contains("priors: unknown class \"poles\"; known are road, pole"));
        for value in [0.0, 101.0, f32::NAN] {
            assert!(refused(("pole", value)).contains(&format!("priors: pole = {value}, must be 0.01 to 100")));
        }
    }
}
