//! The training loop: it learns, is reproducible, and resumes exactly.

use kernels::images::{Border, LANES, Planes};
use random::Random;
use segmentation::network::NetworkSpec;
use training::{
    BevHead, BevLabels, Dataset, Example, Hierarchy, ImageNetwork, Loss, NO_CELL, SparseView, TrainSettings, Trainer,
    UNKNOWN, Variables,
};

const SIZE: [usize; 2] = [4, 16];
const CLASSES: usize = 3;

/// Noise with a bright bar in each row. The classes are the bar, the pixel to the right of it, and all others: a single
/// pixel is ambiguous.
struct Bars(usize);

impl Dataset for Bars {
    fn len(&self) -> usize {
        self.0
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let [height, width] = SIZE;
        let mut own = Random::for_stream(9, index as u64);
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
        Example::new(input, truth)
    }
}

/// [`Bars`] with sparse views of every second row, and classes of the cells of a grid of 8 x 8.
struct BarsTwice(Bars);

impl Dataset for BarsTwice {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let [height, width] = SIZE;
        let example = self.0.example(index, random);
        let input =
            Planes::from_fn([1, height / 2, width], Border::Circular, |_, y, x| example.input.row(0, 2 * y)[x][0]);
        let pixels = (0..height / 2 * width).map(|i| [i, i + i / width * width].map(|i| i as u32)).collect();
        let cells = (0..height * width).map(|i| if i.is_multiple_of(5) { NO_CELL } else { (i % 64) as u32 }).collect();
        let truth = (0..64_u32).map(|cell| if cell.is_multiple_of(3) { UNKNOWN } else { (cell % 2) as u8 }).collect();
        let bev = BevLabels { side: 8, cells, truth };
        Example { sparse_view: Some(SparseView { input, pixels }), bev: Some(bev), ..example }
    }
}

fn settings() -> TrainSettings {
    TrainSettings {
        seed: 4,
        epochs: 6,
        batch: 4,
        learning_rate: 1e-2,
        patience: 100,
        fixed_statistics: 1.0,
        consistency: 0.0,
        bev_head: 0.0,
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
    Trainer::new(settings, variables, CLASSES, 1, Border::Circular, tree).expect("a trainer")
}

/// A trainer with both additional loss terms, including a head on the bird's-eye view.
fn trainer_with_terms() -> Trainer {
    trainer_with_head(0.5, 0.5)
}

fn trainer_with_head(consistency: f64, bev_head: f64) -> Trainer {
    let settings = TrainSettings { consistency, bev_head, ..settings() };
    let spec = NetworkSpec::Unet { inputs: 1, outputs: CLASSES, widths: vec![8, 8], head: None };
    let network = ImageNetwork::new(Variables::random(&spec, settings.seed).expect("variables"), 1, Border::Circular);
    let network = network.with_bev_head(BevHead::random(8, CLASSES, 6).expect("a head"));
    Trainer::from_network(settings, network, CLASSES, Hierarchy::new(vec![0, 1, 1])).expect("a trainer")
}

fn train_with_views(trainer: &mut Trainer, epochs: usize) {
    for _ in 0..epochs {
        trainer.epoch(&BarsTwice(Bars(32)), &Bars(8), &mut |_, _| {}).expect("trains");
    }
}

fn train(trainer: &mut Trainer, epochs: usize) {
    for _ in 0..epochs {
        trainer.epoch(&Bars(32), &Bars(8), &mut |_, _| {}).expect("trains");
    }
}

#[test]
fn network_learns_classes_from_context() {
    let mut trainer = trainer(TrainSettings { epochs: 30, ..settings() });
    let before = trainer.evaluate(&Bars(8)).expect("evaluates").confusion;
    train(&mut trainer, 30);
    assert!(trainer.is_done());
    let after = trainer.evaluate(&Bars(8)).expect("evaluates").confusion;
    let before = before.mean_iou().expect("some");
    let after = after.mean_iou().expect("some");
    assert!(before < 0.5 && after > 0.95, "{before} {after}");
    assert_eq!(trainer.curves().csv().lines().count(), 31);
    assert!(trainer.curves().svg().contains("mIoU"));
}

#[test]
fn resumed_training_gives_same_bytes() {
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
    let error = other.resume(&path).expect_err("another recipe");
    assert!(error.to_string().contains("another recipe"), "{error}");
}

#[test]
fn terms_of_weight_zero_give_bytes_of_training_without_them() {
    let checkpoint = |with_views: bool| {
        let mut trainer = trainer(settings());
        if with_views {
            train_with_views(&mut trainer, 2);
        } else {
            train(&mut trainer, 2);
        }
        trainer.checkpoint().expect("encodes")
    };
    assert_eq!(checkpoint(true), checkpoint(false));
    let has = |key: &str| checkpoint(false).windows(key.len()).any(|bytes| bytes == key.as_bytes());
    assert!(has("average") && !has("consistency") && !has("bev_head"), "unused settings are not in checkpoints");
}

#[test]
fn resumed_training_with_terms_gives_same_bytes_and_head_is_not_in_the_weights() {
    let mut whole = trainer_with_terms();
    train_with_views(&mut whole, 3);
    let mut cut = trainer_with_terms();
    train_with_views(&mut cut, 1);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("checkpoint.safetensors");
    std::fs::write(&path, cut.checkpoint().expect("encodes")).expect("writes");
    let mut resumed = trainer_with_terms();
    resumed.resume(&path).expect("resumes");
    train_with_views(&mut resumed, 2);
    assert_eq!(resumed.checkpoint().expect("encodes"), whole.checkpoint().expect("encodes"));

    let mut plain = trainer(settings());
    train(&mut plain, 3);
    let names = |trainer: &Trainer| trainer.best().tensors.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&whole), names(&plain));
    assert!(whole.best() != plain.best(), "the terms change the weights");
}

#[test]
fn head_alone_and_consistency_alone_change_weights() {
    let trained = |consistency: f64, bev_head: f64| {
        let mut trainer = trainer_with_head(consistency, bev_head);
        train_with_views(&mut trainer, 1);
        trainer.best().clone()
    };
    let [off, consistency, bev_head] = [trained(0.0, 0.0), trained(0.5, 0.0), trained(0.0, 0.5)];
    assert!(off != consistency && off != bev_head && consistency != bev_head);
}

#[test]
fn finished_training_continues_with_more_epochs() {
    let mut short = trainer(TrainSettings { epochs: 2, ..settings() });
    train(&mut short, 2);
    assert!(short.is_done());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("checkpoint.safetensors");
    std::fs::write(&path, short.checkpoint().expect("encodes")).expect("writes");
    let mut longer = trainer(TrainSettings { epochs: 4, ..settings() });
    longer.resume(&path).expect("resumes");
    assert!(!longer.is_done());
    assert_eq!(longer.curves().csv(), short.curves().csv());
    train(&mut longer, 2);
    assert!(longer.is_done());
    assert_eq!(longer.curves().epochs.len(), 4);
}

#[test]
fn number_of_threads_does_not_change_weights() {
    let learned = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut plain = trainer(settings());
        let mut with_terms = trainer_with_terms();
        pool.install(|| train(&mut plain, 2));
        pool.install(|| train_with_views(&mut with_terms, 2));
        [plain, with_terms].map(|trainer| trainer.best().clone())
    };
    assert!(learned(1) == learned(3));
}

#[test]
fn frozen_variables_do_not_change() {
    let mut trainer = trainer(settings());
    trainer.freeze(vec!["down.".to_owned()]);
    let before = trainer.best().clone();
    train(&mut trainer, 1);
    let after = trainer.best();
    assert_eq!(before.tensors["down.0.0.weight"], after.tensors["down.0.0.weight"]);
    assert_ne!(before.tensors["classes.weight"], after.tensors["classes.weight"]);
}

#[test]
fn training_stops_without_improvement() {
    // The learning rate is too small for f32: the weights do not change.
    let mut trainer = trainer(TrainSettings { patience: 2, learning_rate: 1e-12, ..settings() });
    let mut epochs = 0;
    while !trainer.is_done() {
        train(&mut trainer, 1);
        epochs += 1;
    }
    assert_eq!(epochs, 3);
}

#[test]
fn temperature_is_inside_of_search_range() {
    let mut trainer = trainer(TrainSettings { epochs: 3, ..settings() });
    train(&mut trainer, 3);
    let temperature = trainer.temperature(&Bars(16)).expect("evaluates");
    // A result at the limits of the search range would not be a calibration.
    assert!((0.51..3.6).contains(&temperature), "{temperature}");
}
