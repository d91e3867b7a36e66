//! Networks on points with weights from `PyTorch`: `lab/peers/point_networks.py write` wrote the files of
//! `data/points`, with a batch, outputs, gradients and running statistics of torch in f64.

use candle_core::{Device, Tensor, Var};
use random::Random;
use safetensors::SafeTensors;
use segmentation::ModelFile;
use segmentation::points::{Parameters, Pass, PointBatch, PointNetworkSpec, PointPlan};
use std::path::PathBuf;

/// The seed of the first centers, as in the script.
const SEED: u64 = 7;

struct Reference {
    bytes: Vec<u8>,
    spec: PointNetworkSpec,
    parameters: Parameters,
    plan: PointPlan,
    features: Var,
    loss_weights: Tensor,
}

/// Shape and values of a tensor of a file.
fn tensor(bytes: &[u8], name: &str) -> Tensor {
    let file = SafeTensors::deserialize(bytes).expect("safetensors");
    let tensor = file.tensor(name).expect("written by the script");
    let values: Vec<f32> = tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    Tensor::from_vec(values, tensor.shape(), &Device::Cpu).expect("shape of the values")
}

impl Reference {
    fn read(name: &str) -> Self {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/points");
        let path = folder.join(format!("{name}.safetensors"));
        let bytes = std::fs::read(&path).expect("is there");
        let file = ModelFile::read(&path).expect("a model file");
        let spec: PointNetworkSpec = file.settings().expect("a network");
        let list = spec.parameters();
        let parameters = Parameters::from_file(&list, &file).expect("all parameters").trainable(&list).expect("f32");
        let positions = tensor(&bytes, "test.positions").to_vec2::<f32>().expect("rows");
        let positions = positions.iter().map(|p| [p[0], p[1], p[2]]).collect();
        let lengths = tensor(&bytes, "test.lengths").to_vec1::<f32>().expect("a list");
        let batch = PointBatch::new(positions, lengths.iter().map(|n| *n as usize).collect()).expect("valid");
        let plan = spec.plan(batch, SEED).expect("a valid network");
        let features = Var::from_tensor(&tensor(&bytes, "test.features")).expect("f32");
        let loss_weights = tensor(&bytes, "test.loss_weights");
        Self { bytes, spec, parameters, plan, features, loss_weights }
    }
    fn assert_near(&self, got: &Tensor, name: &str) {
        let expected = tensor(&self.bytes, name);
        assert_eq!(got.dims(), expected.dims(), "{name}");
        let values = |t: &Tensor| t.flatten_all().and_then(|t| t.to_vec1::<f32>()).expect("f32");
        let got = values(got);
        let expected = values(&expected);
        // The gradient of a bias before a normalization is 0 in exact arithmetic: its rounding errors are as large as
        // the errors of the weight's gradient.
        let scale = name.strip_suffix(".bias").map(|layer| format!("{layer}.weight"));
        let file = SafeTensors::deserialize(&self.bytes).expect("safetensors");
        let scale =
            scale.filter(|weight| file.tensor(weight).is_ok()).map(|weight| values(&tensor(&self.bytes, &weight)));
        let all = expected.iter().chain(scale.iter().flatten());
        let largest = all.fold(1e-4_f32, |largest, value| largest.max(value.abs()));
        for (i, (got, expected)) in got.iter().zip(&expected).enumerate() {
            assert!((got - expected).abs() <= 1e-4 * largest, "{name} [{i}]: {got} for {expected}, largest {largest}");
        }
    }
    /// Compares scores and gradients of a pass.
    fn check(&self, pass: &mut Pass<'_>, mode: &str) {
        let scores = self.spec.run(pass, &self.plan, &self.features).expect("runs");
        self.assert_near(&scores, &format!("test.{mode}.scores"));
        let mut loss = (&scores * &self.loss_weights).and_then(|products| products.mean_all()).expect("a loss");
        if let Some(term) = pass.regularization() {
            self.assert_near(&term.reshape(1).expect("a scalar"), &format!("test.{mode}.regularization"));
            loss = (loss + (term * 0.1).expect("a scalar")).expect("a scalar");
        }
        let gradients = loss.backward().expect("has gradients");
        let of_features = gradients.get(&self.features).expect("reaches the input");
        self.assert_near(of_features, &format!("test.{mode}.gradient.features"));
        let file = SafeTensors::deserialize(&self.bytes).expect("safetensors");
        let mut n = 0;
        for (name, variable) in self.parameters.variables() {
            let full = format!("test.{mode}.gradient.{name}");
            if file.tensor(&full).is_ok() {
                self.assert_near(gradients.get(variable).expect("reaches each parameter"), &full);
                n += 1;
            }
        }
        assert!(n >= 4 && (mode != "training" || n == self.parameters.variables().len()), "{n} gradients");
    }
}

fn equals_torch(name: &str) {
    let mut reference = Reference::read(name);
    // An evaluation computes no gradients: consecutive layers are one operation.
    let scores = reference.spec.run(&mut Pass::evaluation(&reference.parameters), &reference.plan, &reference.features);
    reference.assert_near(&scores.expect("runs"), "test.evaluation.scores");
    let mut pass = Pass::training_with_running_statistics(&reference.parameters, Random::new(1));
    reference.check(&mut pass, "evaluation");
    let mut pass = Pass::training(&reference.parameters, Random::new(1));
    reference.check(&mut pass, "training");
    let statistics = pass.statistics().clone();
    reference.parameters.update_statistics(&statistics, 0.1).expect("names of the network");
    let mut n = 0;
    for (name, tensor) in reference.parameters.tensors() {
        if name.contains(".running_") || name.starts_with("running_") {
            reference.assert_near(tensor, &format!("test.statistics.{name}"));
            n += 1;
        }
    }
    assert_eq!(n, 2 * statistics.len());
}

#[test]
fn pointnet_with_torch_weights_equals_torch() {
    equals_torch("pointnet");
}

#[test]
fn pointnet2_with_torch_weights_equals_torch() {
    equals_torch("pointnet2");
}

#[test]
fn kpconv_with_torch_weights_equals_torch() {
    equals_torch("kpconv");
}

#[test]
fn waffle_iron_with_torch_weights_equals_torch() {
    equals_torch("waffle_iron");
}

#[test]
fn waffle_iron_with_dense_convolutions_equals_torch() {
    equals_torch("waffle_iron_dense");
}
