//! Trainings that stop and continue, on a table of tiny images.

use crate::experiment::{Experiment, Job, Results, cpu_seconds_left, train_all};
use crate::loss_table::{loss, table_of_losses};
use crate::one_training::{Budget, End, end};
use crate::recipe::{Architecture, Recipe, settings, unet};
use crate::store::Store;
use crate::task::{DataSets, Examples, Task};
use kernels::images::{Border, Planes};
use random::Random;
use segmentation::points::{PlaneConvolution, PointNetworkSpec, WaffleIron};
use std::cell::RefCell;
use std::path::Path;
use training::{Curves, Dataset, Epoch, Example, Hierarchy, PointExample, TrainSettings, UNKNOWN};

const SIDE: usize = 8;

/// Noise with a bright row, which is the class.
struct Rows(u64);

impl Dataset for Rows {
    fn len(&self) -> usize {
        6
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> Example {
        let mut random = Random::for_stream(self.0, index as u64);
        let mut input = Planes::zeros(1, SIDE, SIDE);
        let mut truth = vec![0; SIDE * SIDE];
        let bright = random.index(SIDE);
        for y in 0..SIDE {
            for pixel in input.row_mut(0, y) {
                pixel[0] = 0.3 * random.gauss() + if y == bright { 1.0 } else { 0.0 };
            }
        }
        truth[bright * SIDE..(bright + 1) * SIDE].fill(1);
        Example::new(input, truth)
    }
}

/// Two losses with two seeds, a training that starts from the first one, and one with a class tree from its confusions.
struct Tiny {
    learning_rate: f64,
    data: u64,
    /// Names of data that were loaded.
    loaded: RefCell<usize>,
}

impl Tiny {
    fn new() -> Self {
        Self { learning_rate: 1e-2, data: 1, loaded: RefCell::new(0) }
    }
}

impl Experiment for Tiny {
    fn name(&self) -> &'static str {
        "tiny"
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        let of = |(seed, row): (u64, &str)| Recipe {
            row: row.to_owned(),
            column: "2 filters".to_owned(),
            data: "rows".to_owned(),
            network: unet(1, 2, 2),
            frozen: Vec::new(),
            start: None,
            tree_of: None,
            settings: TrainSettings { epochs: 4, ..settings(2, self.learning_rate, loss(row), seed) },
        };
        let mut recipes: Vec<Recipe> =
            (0..n_seeds).flat_map(|seed| ["CE", "Jac. 2"].map(|row| (seed, row))).map(of).collect();
        let source = recipes[0].clone();
        let of_source = |row: &str| Recipe { row: row.into(), ..source.clone() };
        recipes.push(Recipe { start: Some(Box::new(source.clone())), ..of_source("transfer") });
        let settings = TrainSettings { hierarchy: true, ..source.settings.clone() };
        recipes.push(Recipe { tree_of: Some(Box::new(source.clone())), settings, ..of_source("grown tree") });
        recipes
    }
    fn load(&self, _: &Recipe) -> anyhow::Result<Task> {
        *self.loaded.borrow_mut() += 1;
        let sets = DataSets::<Example> {
            train: Box::new(Rows(self.data)),
            validation: Box::new(Rows(2)),
            tests: vec![("test", Box::new(Rows(3)))],
        };
        let examples = Examples::Images { sets, fold: 1, border: Border::Zero };
        Ok(Task { examples, n_classes: 2, tree: Hierarchy::new(vec![0; 2]) })
    }
    fn cpu_seconds(&self, _: &Recipe) -> f64 {
        1.0
    }
    fn table(&self, results: &Results) -> String {
        table_of_losses(results)
    }
}

const ALL: Job = Job { number: 1, n_parts: 1 };

/// Points on two planes, which are the classes.
struct Layers;

impl Dataset<PointExample> for Layers {
    fn len(&self) -> usize {
        4
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> PointExample {
        let mut random = Random::for_stream(7, index as u64);
        let truth: Vec<u8> = (0..40).map(|i| i % 2).collect();
        let position = |class: &u8| [random.range(-2.0, 2.0), random.range(-2.0, 2.0), f32::from(*class)];
        let positions: Vec<[f32; 3]> = truth.iter().map(position).collect();
        PointExample { features: positions.as_flattened().to_vec(), positions, truth }
    }
}

/// A training on points.
struct TinyPoints;

impl Experiment for TinyPoints {
    fn name(&self) -> &'static str {
        "tiny-points"
    }
    fn recipes(&self, _: u64) -> Vec<Recipe> {
        let of_image = Tiny::new().recipes(1).remove(0);
        let network = PointNetworkSpec::WaffleIron(WaffleIron {
            inputs: 3,
            outputs: 2,
            width: 4,
            depth: 1,
            neighbors: 3,
            cell_m: 0.6,
            low_m: [-2.0; 3],
            high_m: [2.0; 3],
            convolution: PlaneConvolution::DepthWise,
        });
        vec![Recipe { data: "layers".to_owned(), network: Architecture::Points(network), ..of_image }]
    }
    fn load(&self, _: &Recipe) -> anyhow::Result<Task> {
        let data = || -> Box<dyn Dataset<PointExample>> { Box::new(Layers) };
        let sets = DataSets { train: data(), validation: data(), tests: vec![("test", data())] };
        Ok(Task { examples: Examples::Points(sets), n_classes: 2, tree: Hierarchy::new(vec![0; 2]) })
    }
    fn cpu_seconds(&self, _: &Recipe) -> f64 {
        1.0
    }
    fn table(&self, results: &Results) -> String {
        table_of_losses(results)
    }
}

/// Trains within the budget and the job; returns the number of trainings left and the bytes of the results.
fn trained(experiment: &dyn Experiment, folder: &Path, budget: &Budget<'_>, job: Job) -> (usize, String) {
    let recipes = experiment.recipes(2);
    let store = Store::new(folder.into());
    let n_left = train_all(experiment, &recipes, &store, budget, job).expect("trains");
    store.collect(&recipes).expect("writes");
    (n_left, std::fs::read_to_string(folder.join("results.jsonl")).expect("reads"))
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

#[test]
fn interrupted_training_gives_same_results_file() {
    for (experiment, n_trainings) in [(&Tiny::new() as &dyn Experiment, 6), (&TinyPoints, 1)] {
        let whole = folder();
        let cut = folder();
        let (n_left, expected) = trained(experiment, whole.path(), &Budget::new(None), ALL);
        assert_eq!((n_left, expected.lines().count()), (0, n_trainings));
        let mut starts = 0;
        let found = loop {
            let (n_left, text) = trained_one_epoch(experiment, cut.path());
            starts += 1;
            if n_left == 0 {
                break text;
            }
            assert!(starts < 100, "no progress");
        };
        assert!(starts > n_trainings, "{starts} starts: nothing was interrupted");
        assert_eq!(found, expected);
    }
}

/// One more epoch of one training.
fn trained_one_epoch(experiment: &dyn Experiment, folder: &Path) -> (usize, String) {
    let n_checks = std::cell::Cell::new(0);
    // Before the first training, before its first epoch, before its second one.
    let budget = Budget::until(|_| n_checks.replace(n_checks.get() + 1) >= 2);
    trained(experiment, folder, &budget, ALL)
}

#[test]
fn jobs_together_give_same_results_file() {
    let whole = folder();
    let parts = folder();
    let budget = Budget::new(None);
    let (_, expected) = trained(&Tiny::new(), whole.path(), &budget, ALL);
    let (_, half) = trained(&Tiny::new(), parts.path(), &budget, Job { number: 1, n_parts: 2 });
    assert!(half.lines().count() < 6, "{half}");
    let (n_left, found) = trained(&Tiny::new(), parts.path(), &budget, Job { number: 2, n_parts: 2 });
    assert_eq!((n_left, found), (0, expected));
}

#[test]
fn jobs_that_end_together_all_write_the_results() {
    let folder = folder();
    let (_, expected) = trained(&Tiny::new(), folder.path(), &Budget::new(None), ALL);
    let recipes = Tiny::new().recipes(2);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..20 {
                    let store = Store::new(folder.path().into());
                    assert_eq!(store.collect(&recipes).expect("writes").len(), recipes.len());
                }
            });
        }
    });
    assert_eq!(std::fs::read_to_string(folder.path().join("results.jsonl")).expect("reads"), expected);
}

#[test]
fn finished_table_loads_no_data() {
    let folder = folder();
    let tiny = Tiny::new();
    trained(&tiny, folder.path(), &Budget::new(None), ALL);
    trained(&tiny, folder.path(), &Budget::new(None), ALL);
    assert_eq!(*tiny.loaded.borrow(), 1);
}

#[test]
fn changed_setting_sets_results_aside_by_name() {
    let folder = folder();
    trained(&Tiny::new(), folder.path(), &Budget::new(None), ALL);
    let changed = Tiny { learning_rate: 2e-2, ..Tiny::new() };
    let recipes = changed.recipes(2);
    let store = Store::new(folder.path().into());
    assert!(store.collect(&recipes).expect("reads").is_empty(), "results of other settings are not in the table");
    let text = store.set_aside_if_changed(&recipes[0]).expect("renames").expect("was changed");
    assert!(text.contains("2-filters_ce_seed-0") && text.contains("learning_rate = 0.01, now 0.02"), "{text}");
    assert!(folder.path().join("2-filters_ce_seed-0.old-1/result.json").exists());
    // The trainings that depend on the changed one have also changed.
    for (recipe, key) in recipes[4..].iter().zip(["start", "tree_of"]) {
        assert!(store.set_aside_if_changed(recipe).expect("renames").expect("was changed").contains(key));
    }
}

#[test]
fn changed_data_sets_results_aside() {
    let folder = folder();
    trained(&Tiny::new(), folder.path(), &Budget::new(None), ALL);
    let changed = Tiny { data: 4, ..Tiny::new() };
    // If all results exist, no data are loaded: one missing result reveals the change.
    let path = folder.path().join("2-filters_jac.2_seed-1/result.json");
    std::fs::remove_file(&path).expect("removes");
    let (n_left, after) = trained(&changed, folder.path(), &Budget::new(None), ALL);
    assert_eq!((n_left, after.lines().count()), (0, 6));
    for recipe in changed.recipes(2) {
        assert!(folder.path().join(format!("{}.old-1", recipe.name())).exists(), "{}", recipe.name());
    }
}

#[test]
fn published_results_are_not_trained_again_unless_their_weights_or_other_data_are_needed() {
    let first = folder();
    let second = folder();
    let third = folder();
    let (_, expected) = trained(&Tiny::new(), first.path(), &Budget::new(None), ALL);
    let again = |folder: &Path, results: &Path, tiny: &Tiny| {
        let recipes = tiny.recipes(2);
        let store = Store::with_published(folder.into(), results).expect("reads the results");
        let n_left = train_all(tiny, &recipes, &store, &Budget::new(None), ALL).expect("trains");
        store.collect(&recipes).expect("writes");
        (n_left, std::fs::read_to_string(folder.join("results.jsonl")).expect("reads"))
    };
    let published = first.path().join("results.jsonl");
    let tiny = Tiny::new();
    assert_eq!(again(second.path(), &published, &tiny), (0, expected.clone()));
    assert_eq!(*tiny.loaded.borrow(), 0, "nothing is trained");
    // If a training that starts from another is missing, the weights of the other are needed.
    let partial = second.path().join("partial.jsonl");
    let lines: Vec<&str> = expected.lines().collect();
    std::fs::write(&partial, lines[..5].join("\n")).expect("writes");
    assert_eq!(again(second.path(), &partial, &tiny), (0, expected.clone()));
    assert!((1..6).contains(&n_folders(second.path())), "{} trainings", n_folders(second.path()));
    // Other data: none of the published results counts.
    let changed = Tiny { data: 4, ..Tiny::new() };
    std::fs::write(&partial, lines[..5].join("\n")).expect("writes");
    let (n_left, other) = again(third.path(), &partial, &changed);
    assert!(n_left == 0 && other != expected);
    assert_eq!(n_folders(third.path()), 6);
}

#[test]
fn plan_estimates_trainings_beside_published_ones_whose_cost_is_unknown() {
    let first = folder();
    let second = folder();
    let (_, results) = trained(&Tiny::new(), first.path(), &Budget::new(None), ALL);
    let partial = second.path().join("partial.jsonl");
    std::fs::write(&partial, results.lines().take(4).collect::<Vec<_>>().join("\n")).expect("writes");
    let store = Store::with_published(second.path().into(), &partial).expect("reads the results");
    let tiny = Tiny::new();
    let recipes = Tiny::new().recipes(2);
    let seconds = cpu_seconds_left(&tiny, &recipes.iter().collect::<Vec<_>>(), &store).expect("reads");
    assert!((seconds - 2.0).abs() < 1e-9, "{seconds} s for two trainings of 1 s");
    // Nothing left is 0 and not -0.
    std::fs::write(&partial, results).expect("writes");
    let store = Store::with_published(second.path().into(), &partial).expect("reads the results");
    let seconds = cpu_seconds_left(&tiny, &recipes.iter().collect::<Vec<_>>(), &store).expect("reads");
    assert_eq!(format!("{seconds:.2}"), "0.00");
}

fn n_folders(folder: &Path) -> usize {
    std::fs::read_dir(folder).expect("lists").filter(|entry| entry.as_ref().is_ok_and(|e| e.path().is_dir())).count()
}

#[test]
fn table_of_partial_results_counts_seeds() {
    let folder = folder();
    let tiny = Tiny::new();
    let recipes = tiny.recipes(2);
    let store = Store::new(folder.path().into());
    train_all(&tiny, &recipes, &store, &Budget::new(None), Job { number: 1, n_parts: 3 }).expect("trains");
    let results = store.collect(&recipes).expect("reads");
    let table = tiny.table(&results);
    assert_eq!(results.len(), 2, "{table}");
    assert!(table.lines().any(|line| line.starts_with("| CE |") && line.ends_with("0/1 |")), "{table}");
    assert!(table.lines().any(|line| line.starts_with("| Jac. 2 |") && line.ends_with("0/1 |")), "{table}");
}

fn curves(losses: &[f64]) -> Curves {
    let epoch = |&validation_loss: &f64| Epoch { loss: 0.0, validation_loss, mean_iou: 0.5, accuracy: 0.5 };
    Curves { epochs: losses.iter().map(epoch).collect() }
}

#[test]
fn training_ends_after_patience_without_lower_loss() {
    let settings = TrainSettings { patience: 3, epochs: 8, ..settings(1, 1e-3, loss("CE"), 0) };
    let of = |losses: &[f64]| end(&curves(losses), &settings);
    assert_eq!(of(&[]), None);
    assert_eq!(of(&[3.0, 2.0, 2.0, 2.5]), None);
    assert_eq!(of(&[3.0, 2.0, 2.0, 2.5, 2.0]), Some(End::Converged));
    assert_eq!(of(&[8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]), Some(End::EpochLimit));
    assert_eq!(of(&[f64::NAN, f64::NAN, f64::NAN]), Some(End::Converged));
    assert_eq!(end(&curves(&[]), &TrainSettings { epochs: 0, ..settings.clone() }), Some(End::EpochLimit));
}

#[test]
fn job_is_read_from_its_part_and_number() {
    assert_eq!("2/4".parse(), Ok(Job { number: 2, n_parts: 4 }));
    for wrong in ["0/4", "5/4", "2", "a/b", "1/0"] {
        assert!(wrong.parse::<Job>().is_err(), "{wrong}");
    }
}

#[test]
fn masked_labels_are_unknown_and_others_stay() {
    let recipe = &Tiny::new().recipes(1)[0];
    let task = Tiny::new().load(recipe).expect("loads").with_labels_of(&[false, true]);
    let Examples::Images { sets, .. } = &task.examples else { panic!("images") };
    let plain = Rows(1).example(0, None);
    let example = sets.train.example(0, None);
    assert!(example.input.values() == plain.input.values());
    let expected = |class: &u8| if *class == 0 { UNKNOWN } else { *class };
    assert_eq!(example.truth, plain.truth.iter().map(expected).collect::<Vec<_>>());
}
