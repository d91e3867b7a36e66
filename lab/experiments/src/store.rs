//! The folder of a table: one folder per training, and files with the results and costs of all.
//!
//! A training's folder holds `recipe.json`, the checksum of its data, a checkpoint and the CPU seconds so far, and at its end
//! `result.json`. Trainings whose results are published are not repeated.

use crate::outcome::{Line, Outcome};
use crate::recipe::Recipe;
use anyhow::{Context, bail};
use files::atomic_file::write_atomic;
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

const RECIPE: &str = "recipe.json";
const RESULT: &str = "result.json";
const INPUTS: &str = "data_checksum.json";
const SECONDS: &str = "cpu_seconds.json";

/// The folder of a table.
pub struct Store {
    folder: PathBuf,
    /// Published results by the name of the training; results of other settings or data are removed.
    published: RefCell<BTreeMap<String, Line>>,
}

impl Store {
    /// A store without published results.
    #[cfg(test)]
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, published: RefCell::default() }
    }
    /// A store with the published results of a file, if it exists.
    pub fn with_published(folder: PathBuf, results: &Path) -> anyhow::Result<Self> {
        let text = match fs::read_to_string(results) {
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            text => text.with_context(|| results.display().to_string())?,
        };
        let line = |(number, line): (usize, &str)| {
            let line: Line =
                serde_json::from_str(line).with_context(|| format!("{}:{}", results.display(), number + 1))?;
            Ok((line.training.clone(), line))
        };
        let published = text.lines().enumerate().map(line).collect::<anyhow::Result<_>>()?;
        Ok(Self { folder, published: RefCell::new(published) })
    }
    /// A published result, unless there is a training of the same name in the folder.
    fn published<T>(&self, recipe: &Recipe, of_line: impl Fn(&Line) -> T) -> Option<T> {
        let published = self.published.borrow();
        let line = published.get(&recipe.name()).filter(|_| !self.path(recipe, RECIPE).exists());
        line.filter(|line| line.recipe == *recipe).map(of_line)
    }
    fn path(&self, recipe: &Recipe, file: &str) -> PathBuf {
        self.folder.join(recipe.name()).join(file)
    }
    pub fn checkpoint(&self, recipe: &Recipe) -> PathBuf {
        self.path(recipe, "checkpoint.safetensors")
    }
    /// The result of a finished training with exactly these settings.
    pub fn result(&self, recipe: &Recipe) -> anyhow::Result<Option<Outcome>> {
        if let Some(outcome) = self.published(recipe, |line| line.outcome.clone()) {
            return Ok(Some(outcome));
        }
        if self.difference(recipe)?.is_some() {
            return Ok(None);
        }
        read(&self.path(recipe, RESULT))
    }
    /// Whether a training is finished, with its weights if `with_weights`: published results have no weights.
    pub fn is_finished(&self, recipe: &Recipe, with_weights: bool) -> anyhow::Result<bool> {
        Ok(self.result(recipe)?.is_some() && (!with_weights || self.checkpoint(recipe).exists()))
    }
    /// Checksum of the data of a stored training.
    pub fn inputs(&self, recipe: &Recipe) -> anyhow::Result<Option<u64>> {
        match self.published(recipe, |line| line.inputs) {
            Some(inputs) => Ok(Some(inputs)),
            None => read(&self.path(recipe, INPUTS)),
        }
    }
    /// CPU seconds that a training has taken so far.
    pub fn cpu_seconds(&self, recipe: &Recipe) -> anyhow::Result<f64> {
        Ok(read(&self.path(recipe, SECONDS))?.unwrap_or(0.0))
    }
    /// The settings in which a stored training of this name differs, if any.
    fn difference(&self, recipe: &Recipe) -> anyhow::Result<Option<String>> {
        let Some(stored) = read::<serde_json::Value>(&self.path(recipe, RECIPE))? else { return Ok(None) };
        // Encoded as in the file: in a value, numbers of 32 bits would be widened.
        let wanted = serde_json::from_slice(&serde_json::to_vec(recipe)?)?;
        let mut differences = Vec::new();
        compare("", &stored, &wanted, &mut differences);
        Ok((!differences.is_empty()).then(|| differences.join("; ")))
    }
    /// Renames the folder of a stored training with other settings, so that results are never mixed. Returns a message for the
    /// user.
    pub fn set_aside_if_changed(&self, recipe: &Recipe) -> anyhow::Result<Option<String>> {
        let difference = self.difference(recipe)?;
        difference.map(|difference| self.set_aside(recipe, &difference)).transpose()
    }
    /// Renames the folder of a stored training to the first free name. A published result is left out.
    pub fn set_aside(&self, recipe: &Recipe, reason: &str) -> anyhow::Result<String> {
        let name = recipe.name();
        let folder = self.folder.join(recipe.name());
        if self.published.borrow_mut().remove(&name).is_some() && !folder.exists() {
            return Ok(format!("{name}: the published result is not used ({reason})"));
        }
        let old = |n: usize| self.folder.join(format!("{name}.old-{n}"));
        let free = (1..10_000).map(old).find(|path| !path.exists()).context("all names are taken")?;
        fs::rename(&folder, &free).with_context(|| format!("cannot rename {}", folder.display()))?;
        Ok(format!("{name}: the stored training is not used ({reason}); moved to {}", free.display()))
    }
    /// Prepares the folder of a training that starts or continues.
    pub fn begin(&self, recipe: &Recipe, inputs: u64) -> anyhow::Result<()> {
        fs::create_dir_all(self.folder.join(recipe.name()))?;
        write(&self.path(recipe, INPUTS), inputs.to_string().as_bytes())?;
        write(&self.path(recipe, RECIPE), &serde_json::to_vec_pretty(recipe)?)
    }
    pub fn save_checkpoint(&self, recipe: &Recipe, checkpoint: &[u8], cpu_seconds: f64) -> anyhow::Result<()> {
        write(&self.checkpoint(recipe), checkpoint)?;
        write(&self.path(recipe, SECONDS), format!("{cpu_seconds:.1}\n").as_bytes())
    }
    pub fn finish(&self, recipe: &Recipe, outcome: &Outcome) -> anyhow::Result<()> {
        write(&self.path(recipe, RESULT), &serde_json::to_vec(outcome)?)
    }
    /// Writes `results.jsonl` and `costs.csv` of all finished trainings, in the order of the recipes, and returns the results. Jobs that
    /// end together take turns, and the last one has the results of all.
    pub fn collect(&self, recipes: &[Recipe]) -> anyhow::Result<Vec<(Recipe, Outcome)>> {
        fs::create_dir_all(&self.folder)?;
        let turn = File::open(&self.folder).and_then(|folder| folder.lock().map(|()| folder));
        let _turn = turn.with_context(|| format!("cannot lock {}", self.folder.display()))?;
        let mut results = Vec::new();
        let mut lines = String::new();
        let mut costs = String::from("training,epochs,cpu_s\n");
        for recipe in recipes {
            let Some(outcome) = self.result(recipe)? else { continue };
            let inputs = self.inputs(recipe)?.context("a finished training has data")?;
            let line = Line { training: recipe.name(), inputs, recipe: recipe.clone(), outcome: outcome.clone() };
            let _ = writeln!(lines, "{}", serde_json::to_string(&line)?);
            let _ = writeln!(costs, "{},{},{:.1}", recipe.name(), outcome.epochs, self.cpu_seconds(recipe)?);
            results.push((recipe.clone(), outcome));
        }
        write(&self.folder.join("results.jsonl"), lines.as_bytes())?;
        write(&self.folder.join("costs.csv"), costs.as_bytes())?;
        Ok(results)
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_atomic(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// The parsed file; `None` if it does not exist.
fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<Option<T>> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => bail!("cannot read {}: {error}", path.display()),
    };
    let value = serde_json::from_slice(&bytes);
    value.map(Some).with_context(|| format!("{}: not a file of this program; remove its folder", path.display()))
}

/// Lists the fields that differ, with both values.
fn compare(field: &str, stored: &serde_json::Value, wanted: &serde_json::Value, differences: &mut Vec<String>) {
    if let (Some(old), Some(new)) = (stored.as_object(), wanted.as_object()) {
        let names: std::collections::BTreeSet<&String> = old.keys().chain(new.keys()).collect();
        for name in names {
            let none = &serde_json::Value::Null;
            let field = if field.is_empty() { name.clone() } else { format!("{field}.{name}") };
            compare(&field, old.get(name).unwrap_or(none), new.get(name).unwrap_or(none), differences);
        }
    } else if stored != wanted {
        differences.push(format!("{field} = {stored}, now {wanted}"));
    }
}
