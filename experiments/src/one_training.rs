//! One training to its end, or to the end of the budget.

use crate::outcome::{Outcome, Scene};
use crate::recipe::Recipe;
use crate::store::Store;
use crate::task::Task;
use rustix::time::{ClockId, clock_gettime};
use training::{Curves, Hierarchy, TrainSettings, Trainer, Variables};

/// When training stops with a checkpoint: asked before each epoch.
pub struct Budget<'a> {
    begin: f64,
    is_spent: Box<dyn Fn(f64) -> bool + 'a>,
}

impl<'a> Budget<'a> {
    /// After these CPU hours; without a limit, never.
    pub fn new(hours: Option<f64>) -> Self {
        Self::until(move |used| hours.is_some_and(|hours| used >= 3600.0 * hours))
    }
    /// When this holds for the CPU seconds used so far.
    pub fn until(is_spent: impl Fn(f64) -> bool + 'a) -> Self {
        Self { begin: cpu_now(), is_spent: Box::new(is_spent) }
    }
    /// CPU seconds used so far.
    pub fn used(&self) -> f64 {
        cpu_now() - self.begin
    }
    pub fn is_spent(&self) -> bool {
        (self.is_spent)(self.used())
    }
}

/// CPU time of this process, s.
fn cpu_now() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// How a training ends, if it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The validation loss has not fallen for the patience.
    Converged,
    EpochLimit,
}

/// Whether a training with these learning curves has ended. As in the thesis' published code the validation loss decides: set losses
/// fall for many epochs before the first pixel changes its class.
pub fn end(curves: &Curves, settings: &TrainSettings) -> Option<End> {
    let losses: Vec<f64> = curves.epochs.iter().map(|epoch| epoch.validation_loss).collect();
    // The first of equals: a constant loss is no improvement. Losses that are not numbers do not count.
    let best = losses.iter().enumerate().filter(|(_, loss)| loss.is_finite()).min_by(|a, b| a.1.total_cmp(b.1));
    let since_best = losses.len() - best.map_or(0, |(epoch, _)| epoch + 1);
    if since_best >= settings.patience {
        Some(End::Converged)
    } else {
        (losses.len() >= settings.epochs).then_some(End::EpochLimit)
    }
}

/// A training before its first epoch, or as its checkpoint has it.
fn trainer(recipe: &Recipe, task: &Task, store: &Store) -> anyhow::Result<Trainer> {
    let variables = match &recipe.start {
        Some(source) => Variables::from_weights(&recipe.network, trainer(source, task, store)?.best())?,
        None => Variables::random(&recipe.network, recipe.settings.seed)?,
    };
    let tree = match &recipe.tree_of {
        Some(source) => {
            let source = trainer(source, task, store)?.best_trainer()?;
            let (_, confusion) = source.evaluate(task.validation.as_ref())?;
            Hierarchy::of_confusions(&confusion, task.shape.0, task.tree.n_used_nodes())
        }
        None => task.tree.clone(),
    };
    let mut trainer = Trainer::new(recipe.settings.clone(), variables, task.shape, task.border, tree)?;
    trainer.freeze(recipe.frozen.clone());
    if store.checkpoint(recipe).exists() {
        trainer.resume(&store.checkpoint(recipe))?;
    }
    Ok(trainer)
}

/// Begins or continues a training, with a checkpoint after each epoch. `None`: the budget is spent.
pub fn train(
    recipe: &Recipe,
    task: &Task,
    inputs: u64,
    store: &Store,
    budget: &Budget<'_>,
) -> anyhow::Result<Option<Outcome>> {
    let mut trainer = trainer(recipe, task, store)?;
    store.begin(recipe, inputs)?;
    let (before, begin) = (store.cpu_seconds(recipe)?, cpu_now());
    let end = loop {
        if let Some(end) = end(trainer.curves(), &recipe.settings) {
            break end;
        }
        if budget.is_spent() {
            return Ok(None);
        }
        trainer.epoch(task.train.as_ref(), task.validation.as_ref(), &mut |_, _| {})?;
        store.save_checkpoint(recipe, &trainer.checkpoint()?, before + cpu_now() - begin)?;
    };
    let best = trainer.best_trainer()?;
    let scene = |(name, data): &(&'static str, Box<dyn training::Dataset>)| -> anyhow::Result<Scene> {
        Ok(Scene::new(name, task.shape.0, &best.evaluate(data.as_ref())?.1))
    };
    let outcome = Outcome {
        epochs: trainer.curves().epochs.len(),
        best_epoch: trainer.curves().best().map_or(0, |(epoch, _)| epoch + 1),
        converged: end == End::Converged,
        scenes: task.tests.iter().map(scene).collect::<anyhow::Result<_>>()?,
    };
    store.finish(recipe, &outcome)?;
    Ok(Some(outcome))
}
