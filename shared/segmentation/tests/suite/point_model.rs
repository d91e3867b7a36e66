//! Models of the architecture `points`: files, classes of submaps, and unusual submaps.

use candle_core::{Device, Tensor};
use messages::{ClassId, ClassRow, ColorRow, SubmapHeader, SubmapPoint};
use random::Random;
use segmentation::network::{WeightTensor, Weights};
use segmentation::points::{Parameters, PointFeature, PointModel, PointNetworkSpec, PointSettings, SphereSettings};
use segmentation::{ComputeDevice, ModelInput, Options, Report, Segmenter, encode_model, load};
use std::collections::BTreeMap;
use std::path::PathBuf;

const CLASSES: [&str; 3] = ["road", "building", "vegetation"];

/// Settings of a small network of a kind. It has 8 inputs: `offset`, `height`, `intensity`, `one`.
fn settings(network: &str) -> PointSettings {
    PointSettings {
        network: serde_json::from_str::<PointNetworkSpec>(network).expect("a network"),
        classes: CLASSES.map(str::to_owned).into(),
        features: vec![PointFeature::Offset, PointFeature::Height, PointFeature::Intensity, PointFeature::One],
        cell_m: 0.4,
        spheres: SphereSettings { radius_m: 8.0, overlap_m: 2.0 },
        squares: None,
        temperature: 1.0,
        ground_intensities: None,
        notice: None,
    }
}

const WAFFLE_IRON: &str = r#"{"kind": "waffle_iron", "inputs": 8, "outputs": 3, "width": 8, "depth": 3, "neighbors": 6,
    "cell_m": 1.0, "low_m": [-8, -8, -8], "high_m": [8, 8, 8], "convolution": "depth_wise"}"#;

/// Tensors by name.
type Tensors = BTreeMap<String, WeightTensor>;

/// One network of each kind.
const NETWORKS: [&str; 4] = [
    WAFFLE_IRON,
    r#"{"kind": "kpconv", "inputs": 8, "outputs": 3, "width": 8, "levels": 3, "blocks": 1, "kernel_points": 9, "cell_m": 0.4,
        "neighbors": 12}"#,
    r#"{"kind": "pointnet", "inputs": 8, "outputs": 3, "width": 8}"#,
    r#"{"kind": "pointnet2", "inputs": 8, "outputs": 3, "dropout": 0.5, "propagations": [[8], [8]], "abstractions": [
        {"centers": 64, "scales": [{"radius_m": 1.0, "neighbors": 8, "widths": [8]}]},
        {"centers": 16, "scales": [{"radius_m": 4.0, "neighbors": 8, "widths": [8]}]}]}"#,
];

fn weights(settings: &PointSettings) -> Weights {
    let parameters = Parameters::random(&settings.network.parameters(), &mut Random::new(3)).expect("a start");
    parameters.weights().expect("f32")
}

/// A folder with the model file.
fn file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("points.safetensors");
    std::fs::write(&path, bytes).expect("writes");
    (folder, path)
}

fn model(settings: &PointSettings) -> PointModel {
    let (_folder, path) = file(&settings.to_bytes(&weights(settings)).expect("encodes"));
    assert_eq!(load(&path, &Options::default()).expect("loads").card().architecture, "points");
    PointModel::load(&path).expect("loads")
}

/// A road of 40 x 8 m between facades of 6 m.
fn street(n: usize) -> Vec<SubmapPoint> {
    let mut random = Random::new(1);
    let point = |i: usize| {
        let along = random.range(0.0, 40.0);
        let across = random.range(-4.0, 4.0);
        let up = random.range(0.0, 6.0);
        let [x, y, z] = [[along, across, 0.0], [along, -4.0, up], [along, 4.0, up]][i % 3];
        SubmapPoint { x, y, z, intensity: random.index(25) as u8, ..SubmapPoint::default() }
    };
    (0..n).map(point).collect()
}

fn segment(model: &PointModel, points: &[SubmapPoint]) -> (Vec<ClassRow>, Report) {
    let header = SubmapHeader::default();
    let mut classes = vec![ClassRow { class_id: 77, score: 77 }; points.len()];
    let input = ModelInput::new(&header, points);
    let report = model.segment(&input, &mut classes).expect("runs");
    (classes, report)
}

fn is_known(row: ClassRow) -> bool {
    CLASSES.iter().any(|name| ClassId::from_name(name).expect("a class") as u8 == row.class_id) && row.score > 0
}

#[test]
fn model_of_each_kind_gives_every_point_a_class_and_does_not_depend_on_threads() {
    let points = street(6000);
    for network in NETWORKS {
        // The low temperature makes scores differ by more than their rounding.
        let model = model(&PointSettings { temperature: 0.1, ..settings(network) });
        assert_eq!((model.card().architecture.as_str(), model.card().version), ("points", 1));
        let on_threads = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
            pool.install(|| segment(&model, &points))
        };
        let (classes, report) = on_threads(1);
        assert_eq!(classes.len(), points.len(), "{network}");
        assert!(classes.iter().copied().all(is_known), "{network}");
        assert_eq!(report, Report { coarsened: 1, ..Report::default() });
        assert!(on_threads(3).0 == classes, "{network}");
        // A random network gives the points different classes.
        assert!(classes.iter().any(|row| row != &classes[0]), "{network}");
    }
}

#[test]
fn rows_of_the_class_tensors_are_classes() {
    for network in NETWORKS {
        let settings = settings(network);
        for (class, name) in CLASSES.iter().enumerate() {
            let mut weights = weights(&settings);
            for tensor in settings.network.class_tensors() {
                let WeightTensor { shape, values } = weights.tensors.get_mut(tensor).expect("is in the file");
                assert_eq!(shape[0], CLASSES.len(), "{tensor}");
                // The last one has the biases.
                values.fill(0.0);
                values[class] = if shape.len() == 1 { 10.0 } else { 0.0 };
            }
            let (_folder, path) = file(&settings.to_bytes(&weights).expect("encodes"));
            let (classes, _) = segment(&PointModel::load(&path).expect("loads"), &street(600));
            let id = ClassId::from_name(name).expect("a class") as u8;
            assert!(!classes.is_empty() && classes.iter().all(|row| row.class_id == id), "{network} {name}");
        }
    }
}

#[test]
fn points_of_one_cell_get_one_class() {
    let mut points = street(3000);
    points.extend(points.clone());
    let (classes, _) = segment(&model(&settings(WAFFLE_IRON)), &points);
    assert!(classes[..3000] == classes[3000..]);
}

#[test]
fn equal_models_give_equal_bytes() {
    let settings = settings(WAFFLE_IRON);
    let weights = weights(&settings);
    let bytes = settings.to_bytes(&weights).expect("encodes");
    assert_eq!(bytes, settings.to_bytes(&weights).expect("encodes"));
    let (_folder, path) = file(&bytes);
    let model = PointModel::load(&path).expect("loads");
    let read = model.weights().expect("weights");
    assert!(model.settings() == &settings && read == weights);
    assert_eq!(model.settings().to_bytes(&read).expect("encodes"), bytes);
}

#[test]
fn unusual_submaps_are_classified_without_failure() {
    let at = |x: f32, y: f32, z: f32| SubmapPoint { x, y, z, ..SubmapPoint::default() };
    for network in NETWORKS {
        let model = model(&settings(network));
        let of = |points: &[SubmapPoint]| segment(&model, points);
        assert_eq!(of(&[]).1.n_unseen, 0);
        // A network needs neighbors: a point without any neighbor is unlabeled.
        for lonely in [vec![at(1.0, 2.0, 3.0)], vec![at(1.0, 2.0, 3.0); 500]] {
            let (classes, report) = of(&lonely);
            assert_eq!(report.n_unseen, lonely.len(), "{network}");
            let unlabeled = ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 };
            assert_eq!(classes, vec![unlabeled; lonely.len()], "{network}");
        }
        let mut points = street(900);
        points[10] = at(f32::NAN, 0.0, 0.0);
        points[11] = at(0.0, f32::INFINITY, 0.0);
        points[12] = at(2e18, 0.0, 0.0);
        // Isolated and far away: the nearest cell with a class decides.
        points[13] = at(-3e9, 5e12, 1e17);
        points[14] = at(1000.0, 0.0, 0.0);
        let (classes, report) = of(&points);
        assert_eq!(report.n_unseen, 3, "{network}");
        for (i, row) in classes.iter().enumerate() {
            assert_eq!(is_known(*row), ![10, 11, 12].contains(&i), "point {i} of {network}: {row:?}");
        }
    }
}

#[test]
fn color_of_a_point_is_used_where_it_is_a_feature() {
    let network = WAFFLE_IRON.replace("\"inputs\": 8", "\"inputs\": 4");
    let settings = PointSettings { features: vec![PointFeature::ColorHeight], ..settings(&network) };
    let model = model(&settings);
    let points = street(2000);
    let header = SubmapHeader::default();
    let classes = |colors: Option<&[ColorRow]>| {
        let mut classes = vec![ClassRow::default(); points.len()];
        model.segment(&ModelInput { colors, ..ModelInput::new(&header, &points) }, &mut classes).expect("runs");
        classes
    };
    let red: Vec<ColorRow> = (0..2000).map(|i| ColorRow { r: (i % 256) as u8, g: 9, b: 250, camera: 0 }).collect();
    assert_ne!(classes(Some(&red)), classes(None));
}

#[test]
fn unsuitable_settings_are_refused_with_the_rule() {
    let check = |change: &dyn Fn(&mut PointSettings), rule: &str| {
        let mut changed = settings(WAFFLE_IRON);
        let weights = weights(&changed);
        change(&mut changed);
        let (_folder, path) = file(&changed.to_bytes(&weights).expect("encodes"));
        let error = load(&path, &Options::default()).err().expect("is refused").to_string();
        assert!(error.contains("points.safetensors") && error.contains(rule), "{error}");
    };
    check(&|of| of.classes[1] = "trees".to_owned(), "unknown class \"trees\"; known are unlabeled, building");
    check(&|of| of.classes.truncate(2), "network.outputs = 3, must be the 2 classes");
    check(&|of| of.features.truncate(1), "network.inputs = 8, must be the 3 values of the features");
    check(&|of| of.cell_m = 0.001, "cell_m = 0.001, must be 0.02 to 5");
    check(&|of| of.spheres.radius_m = 1000.0, "spheres.radius_m = 1000, must be at most 500 cells");
    check(&|of| of.spheres.overlap_m = -1.0, "overlap_m = -1");
    check(&|of| of.temperature = 0.0, "temperature = 0, must be 0.1 to 10");
    check(&|of| of.network = settings(NETWORKS[2]).network, "tensor `feat.");
    check(
        &|of| {
            of.network = settings(NETWORKS[1]).network;
            of.cell_m = 0.5;
        },
        "network.cell_m must be cell_m = 0.5",
    );
}

#[test]
fn unsuitable_tensors_versions_and_devices_are_refused() {
    let settings = settings(WAFFLE_IRON);
    let refused = |bytes: &[u8], options: &Options, rule: &str| {
        let (_folder, path) = file(bytes);
        let error = load(&path, options).err().expect("is refused").to_string();
        assert!(error.contains(rule), "{error}");
    };
    let bytes = |change: &dyn Fn(&mut Tensors)| {
        let mut weights = weights(&settings);
        change(&mut weights.tensors);
        settings.to_bytes(&weights).expect("encodes")
    };
    let on_cpu = Options::default();
    let insert = |tensors: &mut Tensors, values: Vec<f32>| {
        drop(tensors.insert("classif.bias".to_owned(), WeightTensor { shape: vec![values.len()], values }));
    };
    let without = bytes(&|tensors| drop(tensors.remove("classif.bias")));
    refused(&without, &on_cpu, "tensor `classif.bias`");
    let shape = bytes(&|tensors| insert(tensors, vec![0.0; 2]));
    refused(&shape, &on_cpu, "has shape [2], expected [3]");
    let nan = bytes(&|tensors| insert(tensors, vec![0.0, f32::NAN, 0.0]));
    refused(&nan, &on_cpu, "element 1 is NaN");
    refused(&bytes(&|_| ()), &Options { device: ComputeDevice::Cuda, ..on_cpu }, "run on the CPU only");
    let zeros = Tensor::zeros(1, candle_core::DType::F32, &Device::Cpu).expect("zeros");
    let later = encode_model("points", 2, &settings, BTreeMap::from([("a", zeros)])).expect("encodes");
    refused(&later, &on_cpu, "points has version 2; this program runs version 1");
    let whole = bytes(&|_| ());
    refused(&whole[..whole.len() - 5], &on_cpu, "not a complete safetensors file");
}
