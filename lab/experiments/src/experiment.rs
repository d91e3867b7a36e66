//! Trains all recipes of a table that are not finished, and prints the table.

use crate::one_training::{Budget, train};
use crate::outcome::Outcome;
use crate::recipe::Recipe;
use crate::store::Store;
use crate::task::Task;
use anyhow::Context;

/// Finished trainings.
pub type Results = [(Recipe, Outcome)];

/// A table of the thesis.
pub trait Experiment {
    /// Name of the command and of the folder.
    fn name(&self) -> &'static str;
    /// All trainings in their order. A training comes after its sources.
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe>;
    /// Loads or simulates the data of a recipe.
    fn load(&self, recipe: &Recipe) -> anyhow::Result<Task>;
    /// Estimated CPU seconds of a training, from measurements.
    fn cpu_seconds(&self, recipe: &Recipe) -> f64;
    /// The text of the table of the finished trainings.
    fn table(&self, results: &Results) -> String;
}

/// A part of the trainings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Number of the part, from 1.
    pub number: usize,
    /// Number of parts.
    pub n_parts: usize,
}

impl std::str::FromStr for Job {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = |(number, n_parts): (&str, &str)| {
            Some(Self { number: number.parse().ok()?, n_parts: n_parts.parse().ok()? })
        };
        match text.split_once('/').and_then(parsed) {
            Some(job) if (1..=job.n_parts).contains(&job.number) => Ok(job),
            _ => Err(format!("`{text}` must be I/N with 1 <= I <= N, for example 2/4")),
        }
    }
}

impl Job {
    /// Whether the training at this index belongs to the job.
    fn has(self, index: usize) -> bool {
        index % self.n_parts == self.number - 1
    }
}

/// Runs unfinished trainings within the budget. Returns the number of trainings of the job that remain.
pub fn train_all(
    experiment: &dyn Experiment,
    recipes: &[Recipe],
    store: &Store,
    budget: &Budget<'_>,
    job: Job,
) -> anyhow::Result<usize> {
    for recipe in recipes {
        if let Some(text) = store.set_aside_if_changed(recipe)? {
            eprintln!("{text}");
        }
    }
    // The weights of a source are needed until all trainings that start from it are finished.
    let needs_weights = |recipe: &Recipe| -> anyhow::Result<bool> {
        for of in recipes.iter().filter(|of| of.sources().any(|source| source == recipe)) {
            if store.result(of)?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    };
    let mut loaded: Option<(&str, Task, u64)> = None;
    let mut n_left = 0;
    for (index, recipe) in recipes.iter().enumerate() {
        // All jobs need the weights of sources.
        let is_source = recipes.iter().any(|of| of.sources().any(|source| source == recipe));
        if !(job.has(index) || is_source && job.number == 1) || store.is_finished(recipe, needs_weights(recipe)?)? {
            continue;
        }
        let mut is_ready = true;
        for source in recipe.sources() {
            is_ready &= store.is_finished(source, true)?;
        }
        if budget.is_spent() || !is_ready {
            n_left += 1;
            continue;
        }
        if loaded.as_ref().is_none_or(|(data, ..)| *data != recipe.data) {
            eprintln!("data: {}", recipe.data);
            let task = experiment.load(recipe)?;
            let checksum = task.checksum();
            if set_aside_other_inputs(store, recipes, &recipe.data, checksum)? {
                // Trainings before this one are to be repeated.
                return train_all(experiment, recipes, store, budget, job);
            }
            loaded = Some((&recipe.data, task, checksum));
        }
        let (_, task, checksum) = loaded.as_ref().context("data are loaded above")?;
        let before = budget.used();
        let Some(outcome) = train(recipe, task, *checksum, store, budget)? else {
            n_left += 1;
            continue;
        };
        let percent = 100.0 * outcome.mean_iou();
        let seconds = budget.used() - before;
        eprintln!("{}: {} epochs, mIoU {percent:.1} %, {seconds:.0} CPU s", recipe.name(), outcome.epochs);
    }
    Ok(n_left)
}

/// Sets aside trainings that used other data under the same description, and their dependents. Returns whether any was set aside.
fn set_aside_other_inputs(store: &Store, recipes: &[Recipe], data: &str, checksum: u64) -> anyhow::Result<bool> {
    let mut changed: Vec<&Recipe> = Vec::new();
    for recipe in recipes {
        let is_other = recipe.data == data && store.inputs(recipe)?.is_some_and(|inputs| inputs != checksum);
        let has_other_source = recipe.sources().any(|source| changed.contains(&source));
        if is_other || has_other_source && store.inputs(recipe)?.is_some() {
            eprintln!("{}", store.set_aside(recipe, "its data have changed")?);
            changed.push(recipe);
        }
    }
    Ok(!changed.is_empty())
}

/// Prints the number of trainings, and the CPU hours that they take.
pub fn print_plan(experiment: &dyn Experiment, recipes: &[Recipe], store: &Store) -> anyhow::Result<()> {
    println!(
        "{}\n\n| column | trainings | done | converged | CPU hours left |\n|---|---|---|---|---|",
        experiment.name()
    );
    let mut sum: f64 = 0.0;
    let mut columns: Vec<&str> = Vec::new();
    for recipe in recipes {
        if !columns.contains(&recipe.column.as_str()) {
            columns.push(&recipe.column);
        }
    }
    for column in columns {
        let of_column: Vec<&Recipe> = recipes.iter().filter(|recipe| recipe.column == column).collect();
        let done: Vec<Outcome> =
            of_column.iter().filter_map(|recipe| store.result(recipe).transpose()).collect::<anyhow::Result<_>>()?;
        let estimate = cpu_seconds_left(experiment, &of_column, store)?;
        let converged = done.iter().filter(|outcome| outcome.converged).count();
        println!("| {column} | {} | {} | {converged} | {:.2} |", of_column.len(), done.len(), estimate / 3600.0);
        sum += estimate;
    }
    println!("\n{:.1} CPU hours left\n", sum / 3600.0);
    Ok(())
}

/// CPU seconds that the trainings of a column still take: for each, the mean of the finished trainings with known cost. The
/// cost of published trainings is unknown.
pub fn cpu_seconds_left(experiment: &dyn Experiment, column: &[&Recipe], store: &Store) -> anyhow::Result<f64> {
    let mut known = Vec::new();
    let mut left = Vec::new();
    for recipe in column {
        match store.result(recipe)? {
            Some(_) => known.extend(Some(store.cpu_seconds(recipe)?).filter(|seconds| *seconds > 0.0)),
            None => left.push(experiment.cpu_seconds(recipe)),
        }
    }
    // The sum of no numbers is -0, which would be printed with its sign.
    if left.is_empty() {
        return Ok(0.0);
    }
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    Ok(if known.is_empty() { left.iter().sum() } else { mean * left.len() as f64 })
}

/// Trains, writes the results, and prints the table.
pub fn run(
    experiment: &dyn Experiment,
    store: &Store,
    n_seeds: u64,
    budget: &Budget<'_>,
    job: Job,
) -> anyhow::Result<()> {
    let recipes = experiment.recipes(n_seeds);
    let n_left = train_all(experiment, &recipes, store, budget, job)?;
    let results = store.collect(&recipes)?;
    println!("{}", experiment.table(&results));
    println!("{} of {} trainings are done; {:.2} CPU hours used", results.len(), recipes.len(), budget.used() / 3600.0);
    if n_left > 0 {
        println!("{n_left} trainings of this job remain; start the command again to continue");
    }
    Ok(())
}
