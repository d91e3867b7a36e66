//! Training: it learns, it repeats, and it goes on from a checkpoint as if it had never stopped.

mod support;

use learning::Random;
use learning::engine::{Border, LANES, Planes};
use learning::losses::{Hierarchy, Loss};
use learning::network::{NetworkSpec, Variables};
use learning::training::{Dataset, Example, TrainSettings, Trainer, UNKNOWN};

const SIZE: [usize; 2] = [4, 16];
const CLASSES: usize = 3;

/// Noise with bright bars; the class of a pixel is whether a bar is in its row to the left, at it, or neither. One pixel
/// alone does not tell.
struct Bars(usize);

impl Dataset for Bars {
    fn len(&self) -> usize {
        self.0
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let [height, width] = SIZE;
        let mut own = Random::new(9, index as u64);
        let mut input = Planes::zeros(1, height, width);
        let mut truth = vec![0; height * width];
        for y in 0..height {
            let bar = own.index(width - 1);
            for (x, pixel) in input.row_mut(0, y).iter_mut().enumerate() {
                pixel[0] = 0.2 * own.gauss() + if x == bar { 2.0 } else { 0.0 };
            }
            truth[y * width + bar] = 1;
            truth[y * width + bar + 1] = 2;
        }
        if let Some(random) = random {
            truth[random.index(height * width)] = UNKNOWN;
        }
        input.fill_border(Border::Circular);
        assert_eq!(input.row(0, 0)[0].len(), LANES);
        Example { input, truth }
    }
}

fn settings() -> TrainSettings {
    TrainSettings {
        seed: 4,
        epochs: 6,
        batch: 4,
        learning_rate: 1e-2,
        patience: 100,
        loss: Loss::CrossEntropyPowerJaccard { power: 2.0 },
        hierarchy: true,
        average: 0.5,
        pixels: 200,
    }
}

fn trainer(settings: TrainSettings) -> Trainer {
    let spec = NetworkSpec::Unet { inputs: 1, outputs: CLASSES, widths: vec![8, 8], head: None };
    let variables = Variables::random(&spec, settings.seed).expect("variables");
    let tree = Hierarchy::new(vec![0, 1, 1]);
    Trainer::new(settings, variables, (CLASSES, 1), Border::Circular, tree).expect("a trainer")
}

fn train(trainer: &mut Trainer, epochs: usize) {
    for _ in 0..epochs {
        trainer.epoch(&Bars(32), &Bars(8), &mut |_, _| {}).expect("trains");
    }
}

#[test]
fn a_network_learns_what_one_pixel_does_not_tell() {
    let mut trainer = trainer(TrainSettings { epochs: 30, ..settings() });
    let (_, before) = trainer.evaluate(&Bars(8)).expect("evaluates");
    train(&mut trainer, 30);
    assert!(trainer.is_done());
    let (_, after) = trainer.evaluate(&Bars(8)).expect("evaluates");
    let (before, after) = (before.mean_iou().expect("some"), after.mean_iou().expect("some"));
    assert!(before < 0.5 && after > 0.95, "{before} {after}");
    assert_eq!(trainer.curves().csv().lines().count(), 31);
    assert!(trainer.curves().svg().contains("mIoU"));
}

#[test]
fn a_resumed_training_gives_the_same_bytes() {
    let mut whole = trainer(settings());
    train(&mut whole, 4);
    let mut cut = trainer(settings());
    train(&mut cut, 2);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("checkpoint.safetensors");
    std::fs::write(&path, cut.checkpoint().expect("encodes")).expect("writes");
    let mut resumed = trainer(settings());
    resumed.resume(&path).expect("resumes");
    train(&mut resumed, 2);
    assert_eq!(resumed.checkpoint().expect("encodes"), whole.checkpoint().expect("encodes"));

    let mut other = trainer(TrainSettings { learning_rate: 2e-2, ..settings() });
    let error = other.resume(&path).expect_err("is of another recipe");
    assert!(error.to_string().contains("another recipe"), "{error}");
}

#[test]
fn threads_do_not_show_in_what_is_learned() {
    let learned = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut trainer = trainer(settings());
        pool.install(|| train(&mut trainer, 2));
        trainer.best().clone()
    };
    assert!(learned(1) == learned(3));
}

#[test]
fn frozen_variables_stay() {
    let mut trainer = trainer(settings());
    trainer.freeze(vec!["down.".to_owned()]);
    let before = trainer.best().clone();
    train(&mut trainer, 1);
    let after = trainer.best();
    assert_eq!(before.tensors["down.0.0.weight"], after.tensors["down.0.0.weight"]);
    assert_ne!(before.tensors["classes.weight"], after.tensors["classes.weight"]);
}

#[test]
fn patience_ends_what_does_not_become_better() {
    // Too small for f32: nothing changes.
    let mut trainer = trainer(TrainSettings { patience: 2, learning_rate: 1e-12, ..settings() });
    let mut epochs = 0;
    while !trainer.is_done() {
        train(&mut trainer, 1);
        epochs += 1;
    }
    assert_eq!(epochs, 3);
}

#[test]
fn the_temperature_makes_scores_honest() {
    let mut trainer = trainer(TrainSettings { epochs: 3, ..settings() });
    train(&mut trainer, 3);
    let temperature = trainer.temperature(&Bars(16)).expect("evaluates");
    // A network trained for its Jaccard index alone is too sure or too unsure; the edges of what is tried are no answer.
    assert!((0.51..3.6).contains(&temperature), "{temperature}");
}
