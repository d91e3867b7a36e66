//! Trains one network per loss and seed, and prints a table of scores.

use scores::Confusion;
use segmentation::engine::Border;
use segmentation::network::NetworkSpec;
use training::Variables;
use training::{Dataset, TrainSettings, Trainer, UNKNOWN};
use training::{Hierarchy, Loss};

/// Data, network and settings of a training.
pub struct Task<'a> {
    pub train: &'a dyn Dataset,
    pub validation: &'a dyn Dataset,
    pub test: &'a dyn Dataset,
    pub spec: NetworkSpec,
    /// Number of classes, and number of columns that are folded into one column of the network.
    pub shape: (usize, usize),
    pub border: Border,
    pub tree: Hierarchy,
    /// Seed and loss are replaced for each training.
    pub settings: TrainSettings,
}

/// Settings that all trainings share.
pub fn settings(epochs: usize, batch: usize, learning_rate: f64) -> TrainSettings {
    TrainSettings {
        seed: 0,
        epochs,
        batch,
        learning_rate,
        average: 0.0,
        patience: 5,
        loss: Loss::CrossEntropy,
        hierarchy: false,
        pixels: 0,
    }
}

impl Task<'_> {
    /// Trains these variables. Variables whose names start with one of `frozen` are not changed.
    pub fn trained(&self, settings: TrainSettings, variables: Variables, frozen: &[&str]) -> anyhow::Result<Trainer> {
        let mut trainer = Trainer::new(settings, variables, self.shape, self.border, self.tree.clone())?;
        trainer.freeze(frozen.iter().map(|&prefix| prefix.to_owned()).collect());
        while !trainer.is_done() {
            trainer.epoch(self.train, self.validation, &mut |_, _| {})?;
        }
        Ok(trainer)
    }

    /// The confusion matrix on the test set for each seed, with the weights that were best in validation.
    pub fn confusions(&self, loss: &Loss, hierarchy: bool, n_seeds: u64) -> anyhow::Result<Vec<Confusion>> {
        let of_seed = |seed: u64| {
            let settings = TrainSettings { seed, loss: loss.clone(), hierarchy, ..self.settings.clone() };
            let trainer = self.trained(settings, Variables::random(&self.spec, seed)?, &[])?;
            let (_, confusion) = trainer.best_trainer()?.evaluate(self.test)?;
            let percent = 100.0 * confusion.mean_iou().unwrap_or(0.0);
            eprintln!("{loss:?}, seed {seed}: {} epochs, mIoU {percent:.1} %", trainer.curves().epochs.len());
            Ok(confusion)
        };
        (0..n_seeds).map(of_seed).collect()
    }

    /// Prints one row per loss: mean and deviation of mIoU over the seeds, its minimum and maximum, and the mean IoU of each class.
    pub fn table_of_losses(&self, losses: &[(String, Loss)], names: &[&str], n_seeds: u64) -> anyhow::Result<()> {
        println!("| loss | mIoU | min | max | {} |", names.join(" | "));
        println!("|---|---|---|---|{}", "---|".repeat(names.len()));
        for (name, loss) in losses {
            let confusions = self.confusions(loss, false, n_seeds)?;
            let mean_ious: Vec<f64> = confusions.iter().map(|c| c.mean_iou().unwrap_or(0.0)).collect();
            let (mean, deviation) = mean_and_deviation(&mean_ious);
            let [least, best] = min_and_max(&mean_ious);
            let ious = |class: usize| confusions.iter().map(|c| c.class(class).iou.unwrap_or(0.0)).collect::<Vec<_>>();
            let of_classes: Vec<String> =
                (0..names.len()).map(|class| format!("{:.3}", mean_and_deviation(&ious(class)).0)).collect();
            println!("| {name} | {mean:.3} ± {deviation:.3} | {least:.3} | {best:.3} | {} |", of_classes.join(" | "));
        }
        Ok(())
    }
}

/// The losses of chapter 5, with one weight per class, and the Power Jaccard losses of these powers.
pub fn losses(weights: Vec<f32>, powers: &[f64]) -> Vec<(String, Loss)> {
    let classic = [
        ("CE", Loss::CrossEntropy),
        ("weighted CE", Loss::WeightedCrossEntropy { weights }),
        ("focal 2", Loss::Focal { gamma: 2.0 }),
        ("Dice", Loss::Dice),
        ("Tversky 0.3, 0.7", Loss::Tversky { alpha: 0.3, beta: 0.7 }),
        ("Jac. 1", Loss::Jaccard),
    ];
    let classic = classic.into_iter().map(|(name, loss)| (name.to_owned(), loss));
    classic.chain(powers.iter().map(|&power| (format!("Jac. {power}"), Loss::PowerJaccard { power }))).collect()
}

/// Class weights: the square root of the frequency of the most frequent class divided by that of the class, at most 10. The full
/// ratio would suppress frequent classes.
pub fn weights(data: &dyn Dataset, n_classes: usize) -> Vec<f32> {
    let mut counts = vec![0_u32; n_classes];
    for class in (0..data.len()).flat_map(|i| data.example(i, None).truth).filter(|&class| class != UNKNOWN) {
        counts[usize::from(class)] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(1) as f32;
    counts.iter().map(|&n| (most / n.max(1) as f32).sqrt().min(10.0)).collect()
}

/// Mean and standard deviation.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

/// Minimum and maximum.
pub fn min_and_max(values: &[f64]) -> [f64; 2] {
    [values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
}
