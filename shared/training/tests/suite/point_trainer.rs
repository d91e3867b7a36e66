//! Training of networks on points: they learn, are reproducible, and resume exactly.

use random::Random;
use segmentation::points::PointNetworkSpec;
use training::{Dataset, Evaluation, Hierarchy, Loss, PointExample, PointNetwork, TrainSettings, Trainer, UNKNOWN};

const CLASSES: usize = 3;

/// Spheres with ground, a wall and a pole; features are 1 and noise, so only the shape of the neighborhood shows the
/// class.
struct Streets(usize);

impl Dataset<PointExample> for Streets {
    fn len(&self) -> usize {
        self.0
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> PointExample {
        let mut own = Random::for_stream(9, index as u64);
        let mut positions = Vec::new();
        let mut features = Vec::new();
        let mut truth = Vec::new();
        for i in 0..240 {
            let a = own.range(-3.0, 3.0);
            let b = own.range(0.0, 3.0);
            let class = i % CLASSES;
            positions.push([[a, 2.0 * b - 3.0, 0.0], [a, 3.0, b], [0.02 * a, 0.0, b]][class]);
            features.extend([positions[i][0], positions[i][1], positions[i][2], own.gauss()]);
            truth.push(class as u8);
        }
        if let Some(random) = random {
            truth[random.index(240)] = UNKNOWN;
        }
        PointExample { positions, features, truth }
    }
}

/// One example without points, one with a single point, one without labels.
struct Unusual;

impl Dataset<PointExample> for Unusual {
    fn len(&self) -> usize {
        3
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> PointExample {
        let n = [0, 1, 20][index];
        let positions = (0..n).map(|i| [0.1 * i as f32, 0.0, 0.0]).collect();
        PointExample { positions, features: vec![0.0; 4 * n], truth: vec![if n == 1 { 0 } else { UNKNOWN }; n] }
    }
}

fn settings() -> TrainSettings {
    TrainSettings {
        seed: 4,
        epochs: 4,
        batch: 2,
        learning_rate: 1e-2,
        patience: 100,
        loss: Loss::CrossEntropyPowerJaccard { power: 2.0 },
        hierarchy: true,
        average: 0.5,
        // Within the second epoch.
        fixed_statistics: 0.4,
        consistency: 0.0,
        bev_head: 0.0,
        pixels: 300,
    }
}

const NETWORKS: [&str; 4] = [
    r#"{"kind": "waffle_iron", "inputs": 4, "outputs": 3, "width": 8, "depth": 3, "neighbors": 6, "cell_m": 1.0,
        "low_m": [-3, -3, -3], "high_m": [3, 3, 3], "convolution": "depth_wise"}"#,
    r#"{"kind": "kpconv", "inputs": 4, "outputs": 3, "width": 8, "levels": 2, "blocks": 1, "kernel_points": 9, "cell_m": 0.4,
        "neighbors": 12}"#,
    r#"{"kind": "pointnet", "inputs": 4, "outputs": 3, "width": 8}"#,
    r#"{"kind": "pointnet2", "inputs": 4, "outputs": 3, "dropout": 0.2, "propagations": [[16], [16]], "abstractions": [
        {"centers": 64, "scales": [{"radius_m": 1.0, "neighbors": 8, "widths": [16]}]},
        {"centers": 16, "scales": [{"radius_m": 3.0, "neighbors": 8, "widths": [16]}]}]}"#,
];

fn trainer(network: &str, settings: TrainSettings) -> Trainer<PointNetwork> {
    let spec: PointNetworkSpec = network_of(network);
    let network = PointNetwork::random(&spec, settings.seed).expect("a network");
    Trainer::from_network(settings, network, CLASSES, Hierarchy::new(vec![0, 1, 1])).expect("a trainer")
}

/// The settings of a network as the metadata of a model file.
fn network_of(text: &str) -> PointNetworkSpec {
    serde_json::from_str(text).expect("a network")
}

fn train(trainer: &mut Trainer<PointNetwork>, epochs: usize) {
    for _ in 0..epochs {
        trainer.epoch(&Streets(8), &Streets(4), &mut |_, _| {}).expect("trains");
    }
}

#[test]
fn point_network_of_each_kind_learns() {
    // PointNet has no neighborhoods, and its transforms have statistics of as many rows as a batch has clouds.
    for (network, limits) in NETWORKS.into_iter().zip([[0.7, 0.6], [0.7, 0.6], [0.85, 0.4], [0.7, 0.6]]) {
        let mut trainer = trainer(network, TrainSettings { epochs: 12, ..settings() });
        let before = trainer.evaluate(&Streets(4)).expect("evaluates").loss;
        train(&mut trainer, 12);
        let Evaluation { loss: after, confusion } = trainer.evaluate(&Streets(4)).expect("evaluates");
        let mean_iou = confusion.mean_iou().expect("some");
        assert!(
            after < limits[0] * before && mean_iou > limits[1],
            "{network}: loss {before} to {after}, mIoU {mean_iou}"
        );
        let losses: Vec<f64> = trainer.curves().epochs.iter().map(|epoch| epoch.loss).collect();
        assert!(losses[11] < 0.8 * losses[0], "{network}: {losses:?}");
    }
}

#[test]
fn resumed_training_of_points_gives_same_bytes() {
    for network in NETWORKS {
        let mut whole = trainer(network, settings());
        train(&mut whole, 2);
        let mut cut = trainer(network, settings());
        train(&mut cut, 1);
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("checkpoint.safetensors");
        std::fs::write(&path, cut.checkpoint().expect("encodes")).expect("writes");
        let mut resumed = trainer(network, settings());
        resumed.resume(&path).expect("resumes");
        train(&mut resumed, 1);
        assert!(resumed.checkpoint().expect("encodes") == whole.checkpoint().expect("encodes"), "{network}");
        let mut other = trainer(network, TrainSettings { batch: 1, ..settings() });
        assert!(other.resume(&path).expect_err("another recipe").to_string().contains("another recipe"));
    }
}

#[test]
fn number_of_threads_does_not_change_point_weights() {
    let learned = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut trainer = trainer(NETWORKS[0], settings());
        pool.install(|| train(&mut trainer, 1));
        trainer.checkpoint().expect("encodes")
    };
    assert!(learned(1) == learned(3));
}

#[test]
fn frozen_point_variables_do_not_change_and_statistics_do() {
    let mut trainer = trainer(NETWORKS[0], settings());
    trainer.freeze(vec!["embed.".to_owned()]);
    let before = trainer.best().clone();
    train(&mut trainer, 1);
    let after = trainer.best();
    assert_eq!(before.tensors["embed.conv1.weight"], after.tensors["embed.conv1.weight"]);
    assert_ne!(before.tensors["classif.weight"], after.tensors["classif.weight"]);
    assert_ne!(before.tensors["embed.norm.running_mean"], after.tensors["embed.norm.running_mean"]);
}

#[test]
fn fixed_statistics_stay_and_variables_do_not() {
    let mut trainer = trainer(NETWORKS[0], TrainSettings { fixed_statistics: 0.5, ..settings() });
    let values = |trainer: &Trainer<PointNetwork>, name: &str| {
        let checkpoint = trainer.checkpoint().expect("encodes");
        let tensors = candle_core::safetensors::load_buffer(&checkpoint, &candle_core::Device::Cpu).expect("decodes");
        tensors[name].flatten_all().and_then(|tensor| tensor.to_vec1::<f32>()).expect("numbers")
    };
    let of_norm = |trainer: &Trainer<PointNetwork>| values(trainer, "variable.embed.norm.running_mean");
    train(&mut trainer, 1);
    let first = of_norm(&trainer);
    train(&mut trainer, 2);
    let third = (of_norm(&trainer), values(&trainer, "variable.classif.weight"));
    train(&mut trainer, 1);
    let fourth = (of_norm(&trainer), values(&trainer, "variable.classif.weight"));
    assert_ne!(first, third.0);
    assert_eq!(third.0, fourth.0);
    assert_ne!(third.1, fourth.1);
}

#[test]
fn examples_without_neighbors_or_labels_are_passed_over() {
    let mut trainer = trainer(NETWORKS[0], TrainSettings { batch: 1, ..settings() });
    let before = trainer.best().clone();
    trainer.epoch(&Unusual, &Unusual, &mut |_, _| {}).expect("trains");
    assert!(trainer.best() == &before);
    assert_eq!(trainer.curves().epochs[0].loss, 0.0);
    // PointNet normalizes over the clouds of a batch: a batch of one cloud changes nothing.
    let mut trainer = self::trainer(NETWORKS[2], TrainSettings { batch: 1, ..settings() });
    let before = trainer.best().clone();
    trainer.epoch(&Streets(1), &Streets(1), &mut |_, _| {}).expect("trains");
    assert!(trainer.best() == &before);
}
