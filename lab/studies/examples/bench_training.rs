//! Training steps per second of the shipped network: `cargo run --release -p studies --example bench_training`.
//! `lab/peers/training.py` runs it for the comparison with `PyTorch`. `RAYON_NUM_THREADS` sets the threads.

use kernels::images::{Border, Planes};
use messages::ClassId;
use random::Random;
use segmentation::network::NetworkSpec;
use std::time::Instant;
use training::{Dataset, Example, Hierarchy, Loss, TrainSettings, Trainer, TrainingError, Variables};

/// Rows and columns of a folded sweep of 32 rings.
const SIZE: [usize; 2] = [32, 512];
const FOLD: usize = 4;
const N_FEATURES: usize = 10;
const N_CLASSES: usize = 19;
const BATCH: usize = 4;
const STEPS: usize = 4;
/// Epochs of [`STEPS`]; the fastest counts, since the machine may be shared.
const EPOCHS: usize = 5;

/// Examples of noise.
struct Noise(Vec<(Planes, Vec<u8>)>);

impl Noise {
    fn new(n: usize) -> Self {
        let [height, width] = SIZE;
        let example = |index: usize| {
            let mut random = Random::for_stream(1, index as u64);
            let size = [FOLD * N_FEATURES, height, width];
            let input = Planes::from_fn(size, Border::Circular, |_, _, _| random.gauss());
            (input, (0..height * width * FOLD).map(|_| random.index(N_CLASSES) as u8).collect())
        };
        Self((0..n).map(example).collect())
    }
}

impl Dataset for Noise {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> Example {
        let (input, truth) = self.0[index].clone();
        Example::new(input, truth)
    }
}

fn main() -> Result<(), TrainingError> {
    allocator::restart_with_kept_memory(allocator::Keep::Large);
    for hierarchy in [false, true] {
        let loss = if hierarchy {
            Loss::WeightedCrossEntropyPowerJaccard { weights: vec![1.0; N_CLASSES], power: 2.0 }
        } else {
            Loss::CrossEntropy
        };
        let settings = TrainSettings {
            seed: 1,
            epochs: EPOCHS,
            batch: BATCH,
            learning_rate: 1e-3,
            average: 0.998,
            fixed_statistics: 1.0,
            consistency: 0.0,
            bev_head: 0.0,
            patience: EPOCHS,
            loss,
            hierarchy,
            pixels: if hierarchy { 24_000 } else { 0 },
        };
        let inputs = FOLD * N_FEATURES;
        let outputs = FOLD * N_CLASSES;
        let spec = NetworkSpec::Unet { inputs, outputs, widths: vec![32, 48, 64, 96], head: Some(64) };
        let variables = Variables::random(&spec, 1)?;
        let tree = Hierarchy::from_classes(&ClassId::ALL[1..=N_CLASSES]);
        let mut trainer = Trainer::new(settings, variables, N_CLASSES, FOLD, Border::Circular, tree)?;
        let data = Noise::new(BATCH * STEPS);
        let validation = Noise::new(1);
        let mut fastest = f64::INFINITY;
        for _ in 0..EPOCHS {
            let mut steps = [0.0; STEPS];
            let begin = Instant::now();
            trainer.epoch(&data, &validation, &mut |done, _| {
                steps[done - 1] = begin.elapsed().as_secs_f64();
            })?;
            fastest = fastest.min(steps[STEPS - 1] / STEPS as f64);
        }
        let what = if hierarchy { "all losses of the shipped recipe" } else { "cross-entropy of all pixels" };
        println!("{what}: {:.3} s/step of {BATCH} sweeps, {:.2} steps/s", fastest, 1.0 / fastest);
    }
    Ok(())
}
