//! One training to its end, or to the end of the budget.

use crate::outcome::{Outcome, Scene};
use crate::recipe::{Architecture, Recipe};
use crate::store::Store;
use crate::task::{DataSets, Examples, Task};
use anyhow::anyhow;
use rustix::time::{ClockId, clock_gettime};
use training::{Curves, Dataset, Hierarchy, ImageNetwork, Network, PointNetwork, TrainSettings, Trainer, Variables};

/// The condition at which training stops with a checkpoint, checked before each epoch.
pub struct Budget<'a> {
    begin: f64,
    is_spent: Box<dyn Fn(f64) -> bool + 'a>,
}

impl<'a> Budget<'a> {
    /// A budget of these CPU hours; unlimited for `None`.
    pub fn new(hours: Option<f64>) -> Self {
        Self::until(move |used| hours.is_some_and(|hours| used >= 3600.0 * hours))
    }
    /// A budget that is spent when this holds for the CPU seconds used so far.
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

/// Reason for the end of a training.
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
    // The first of equals: a constant loss is not an improvement. Losses that are not finite do not count.
    let best = losses.iter().enumerate().filter(|(_, loss)| loss.is_finite()).min_by(|a, b| a.1.total_cmp(b.1));
    let since_best = losses.len() - best.map_or(0, |(epoch, _)| epoch + 1);
    if since_best >= settings.patience {
        Some(End::Converged)
    } else {
        (losses.len() >= settings.epochs).then_some(End::EpochLimit)
    }
}

/// Data that the trainings of a table on one kind of examples share.
struct Trainings<'a, N: Network> {
    sets: &'a DataSets<N::Example>,
    task: &'a Task,
    store: &'a Store,
    /// The network of a recipe with random weights.
    random: &'a dyn Fn(&Recipe) -> anyhow::Result<N>,
}

impl<N: Network> Trainings<'_, N> {
    /// A training before its first epoch, or restored from its checkpoint.
    fn trainer(&self, recipe: &Recipe) -> anyhow::Result<Trainer<N>> {
        let mut network = (self.random)(recipe)?;
        if let Some(source) = &recipe.start {
            network = network.with_weights(self.trainer(source)?.best())?;
        }
        let Task { n_classes, tree, .. } = self.task;
        let tree = match &recipe.tree_of {
            Some(source) => {
                let source = self.trainer(source)?.best_trainer()?;
                let confusion = source.evaluate(self.sets.validation.as_ref())?.confusion;
                Hierarchy::from_confusions(&confusion, *n_classes, tree.n_used_nodes())
            }
            None => tree.clone(),
        };
        let mut trainer = Trainer::from_network(recipe.settings.clone(), network, *n_classes, tree)?;
        trainer.freeze(recipe.frozen.clone());
        if self.store.checkpoint(recipe).exists() {
            trainer.resume(&self.store.checkpoint(recipe))?;
        }
        Ok(trainer)
    }

    /// Starts or continues a training, with a checkpoint after each epoch. `None`: the budget is spent.
    fn train(&self, recipe: &Recipe, inputs: u64, budget: &Budget<'_>) -> anyhow::Result<Option<Outcome>> {
        let Self { sets, task, store, .. } = self;
        let mut trainer = self.trainer(recipe)?;
        store.begin(recipe, inputs)?;
        let before = store.cpu_seconds(recipe)?;
        let begin = cpu_now();
        let end = loop {
            if let Some(end) = end(trainer.curves(), &recipe.settings) {
                break end;
            }
            if budget.is_spent() {
                return Ok(None);
            }
            trainer.epoch(sets.train.as_ref(), sets.validation.as_ref(), &mut |_, _| {})?;
            store.save_checkpoint(recipe, &trainer.checkpoint()?, before + cpu_now() - begin)?;
        };
        let best = trainer.best_trainer()?;
        let scene = |(name, data): &(&'static str, Box<dyn Dataset<N::Example>>)| -> anyhow::Result<Scene> {
            Ok(Scene::new(name, task.n_classes, &best.evaluate(data.as_ref())?.confusion))
        };
        let outcome = Outcome {
            epochs: trainer.curves().epochs.len(),
            best_epoch: trainer.curves().best().map_or(0, |best| best.epoch + 1),
            converged: end == End::Converged,
            scenes: sets.tests.iter().map(scene).collect::<anyhow::Result<_>>()?,
        };
        store.finish(recipe, &outcome)?;
        Ok(Some(outcome))
    }
}

/// Starts or continues a training, with a checkpoint after each epoch. `None`: the budget is spent.
pub fn train(
    recipe: &Recipe,
    task: &Task,
    inputs: u64,
    store: &Store,
    budget: &Budget<'_>,
) -> anyhow::Result<Option<Outcome>> {
    let other = |recipe: &Recipe| anyhow!("{}: the network does not fit the kind of its data", recipe.name());
    match &task.examples {
        Examples::Images { sets, fold, border } => {
            let random = |recipe: &Recipe| match &recipe.network {
                Architecture::Images(network) => {
                    Ok(ImageNetwork::new(Variables::random(network, recipe.settings.seed)?, *fold, *border))
                }
                Architecture::Points(_) => Err(other(recipe)),
            };
            Trainings { sets, task, store, random: &random }.train(recipe, inputs, budget)
        }
        Examples::Points(sets) => {
            let random = |recipe: &Recipe| match &recipe.network {
                Architecture::Points(network) => Ok(PointNetwork::random(network, recipe.settings.seed)?),
                Architecture::Images(_) => Err(other(recipe)),
            };
            Trainings { sets, task, store, random: &random }.train(recipe, inputs, budget)
        }
    }
}
