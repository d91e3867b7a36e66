//! Gradients of the networks on points compared with finite differences, and results compared across numbers of
//! threads.

use candle_core::{Device, Tensor, Var};
use random::Random;
use segmentation::points::{Parameters, Pass, PointBatch, PointNetworkSpec};

fn gauss(random: &mut Random, shape: &[usize]) -> Tensor {
    let values: Vec<f32> = (0..shape.iter().product()).map(|_| random.gauss()).collect();
    Tensor::from_vec(values, shape, &Device::Cpu).expect("shape of the values")
}

/// The sum of the values times fixed weights, in f64.
fn loss_of(values: &Tensor) -> f64 {
    let values = values.flatten_all().and_then(|values| values.to_vec1::<f32>()).expect("f32");
    let mut random = Random::new(99);
    values.iter().map(|value| f64::from(*value) * f64::from(random.gauss())).sum()
}

fn loss_tensor(values: &Tensor) -> Tensor {
    let weights = gauss(&mut Random::new(99), values.dims());
    (values * weights).and_then(|products| products.sum_all()).expect("a sum")
}

const NETWORKS: [&str; 5] = [
    r#"{"kind": "pointnet", "inputs": 4, "outputs": 3, "width": 4}"#,
    r#"{"kind": "pointnet2", "inputs": 4, "outputs": 3, "dropout": 0.0, "propagations": [[8], [12, 8]], "abstractions": [
        {"centers": 30, "scales": [{"radius_m": 0.5, "neighbors": 6, "widths": [8, 8]}, {"radius_m": 1.0, "neighbors": 8, "widths": [8]}]},
        {"centers": 8, "scales": [{"radius_m": 1.5, "neighbors": 6, "widths": [12]}]}]}"#,
    r#"{"kind": "kpconv", "inputs": 4, "outputs": 3, "width": 8, "levels": 3, "blocks": 1, "kernel_points": 15, "cell_m": 0.2,
        "neighbors": 12}"#,
    r#"{"kind": "waffle_iron", "inputs": 4, "outputs": 3, "width": 8, "depth": 3, "neighbors": 4, "cell_m": 0.5,
        "low_m": [-1, -1, -1], "high_m": [1, 1, 1], "convolution": "depth_wise"}"#,
    r#"{"kind": "waffle_iron", "inputs": 4, "outputs": 3, "width": 8, "depth": 3, "neighbors": 4, "cell_m": 0.5,
        "low_m": [-1, -1, -1], "high_m": [1, 1, 1], "convolution": "dense"}"#,
];

fn network(text: &str) -> (PointNetworkSpec, PointBatch, Tensor) {
    let mut random = Random::new(8);
    let spec: PointNetworkSpec = serde_json::from_str(text).expect("a network");
    let positions = (0..160).map(|_| std::array::from_fn(|_| random.range(-1.0, 1.0))).collect();
    // PointNet normalizes one row for each cloud: with few clouds, a finite difference would need smaller steps than
    // f32 resolves.
    let lengths = if matches!(spec, PointNetworkSpec::Pointnet(_)) { vec![5; 32] } else { vec![40; 4] };
    let batch = PointBatch::new(positions, lengths).expect("valid");
    let features = gauss(&mut random, &[160, 4]);
    (spec, batch, features)
}

#[test]
fn network_gradients_equal_finite_differences() {
    for text in NETWORKS {
        let (spec, batch, features) = network(text);
        let plan = spec.plan(batch, 1).expect("valid");
        let list = spec.parameters();
        let parameters =
            Parameters::random(&list, &mut Random::new(2)).and_then(|p| p.trainable(&list)).expect("a start");
        for training in [false, true] {
            let run = || {
                let mut pass = Pass::training_with_running_statistics(&parameters, Random::new(3));
                if training {
                    pass = Pass::training(&parameters, Random::new(3));
                }
                let scores = spec.run(&mut pass, &plan, &features).expect("runs");
                (loss_of(&scores), loss_tensor(&scores))
            };
            let gradients = run().1.backward().expect("has gradients");
            let variables: Vec<&Var> = parameters.variables().values().collect();
            let starts: Vec<Tensor> = variables.iter().map(|v| v.as_tensor().copy().expect("f32")).collect();
            let directions: Vec<Tensor> =
                variables.iter().map(|v| gradients.get(v).expect("reaches each parameter").clone()).collect();
            let square =
                |t: &Tensor| t.sqr().and_then(|t| t.sum_all()).and_then(|t| t.to_scalar::<f32>()).expect("f32");
            let norm = f64::from(directions.iter().map(square).sum::<f32>()).sqrt();
            // The derivative along the gradient is its length.
            let at = |offset: f64| {
                for ((variable, start), direction) in variables.iter().zip(&starts).zip(&directions) {
                    let moved = (direction * (offset / norm)).and_then(|step| start + step).expect("same shape");
                    variable.set(&moved).expect("same shape");
                }
                run().0
            };
            let step = 2e-4_f64.min(0.03 / norm);
            let difference = (at(step) - at(-step)) / (2.0 * step);
            at(0.0);
            let error = (difference - norm).abs() / norm;
            assert!(error < 0.02, "{text}, training {training}: {difference} for {norm}");
        }
    }
}

#[test]
fn network_results_do_not_depend_on_the_number_of_threads() {
    for text in NETWORKS {
        let results = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            pool.install(|| {
                let (spec, batch, features) = network(text);
                let plan = spec.plan(batch, 1).expect("valid");
                let list = spec.parameters();
                let parameters =
                    Parameters::random(&list, &mut Random::new(2)).and_then(|p| p.trainable(&list)).expect("a start");
                let mut pass = Pass::training(&parameters, Random::new(3));
                let scores = spec.run(&mut pass, &plan, &features).expect("runs");
                let gradients = loss_tensor(&scores).backward().expect("has gradients");
                let mut tensors = vec![scores];
                tensors.extend(parameters.variables().values().map(|v| gradients.get(v).expect("reached").clone()));
                let bits = |t: Tensor| t.flatten_all().and_then(|t| t.to_vec1::<f32>()).expect("f32");
                tensors.into_iter().flat_map(bits).map(f32::to_bits).collect::<Vec<u32>>()
            })
        });
        assert!(results[0] == results[1] && results[0] == results[2], "{text}");
    }
}

#[test]
fn invalid_networks_and_batches_are_rejected() {
    let problem = |text: &str| serde_json::from_str::<PointNetworkSpec>(text).expect("a network").problem();
    assert!(NETWORKS.iter().all(|text| problem(text).is_none()));
    let kpconv = |width: &str, cell_m: &str| {
        let text = format!(
            r#"{{"kind": "kpconv", "inputs": 4, "outputs": 3, "width": {width}, "levels": 3, "blocks": 1, "kernel_points": 15,
                "cell_m": {cell_m}, "neighbors": 12}}"#
        );
        problem(&text).unwrap_or_default()
    };
    assert_eq!(kpconv("6", "0.1"), "width = 6; must be a multiple of 4");
    assert_eq!(kpconv("8", "0.0"), "a length of 0 m, must be 0.0001 to 10000");
    assert_eq!(kpconv("18446744073709551612", "0.1"), "16388 channels or centers, must be 1 to 4096");
    let unknown = r#"{"kind": "pointnet", "inputs": 4, "outputs": 3, "width": 4, "depth": 2}"#;
    assert!(serde_json::from_str::<PointNetworkSpec>(unknown).is_err());
    let planes = r#"{"kind": "waffle_iron", "inputs": 1, "outputs": 3, "width": 8, "depth": 3, "neighbors": 4, "cell_m": 0.01,
        "low_m": [-10, -10, -1], "high_m": [10, 10, 1], "convolution": "dense"}"#;
    let spec: PointNetworkSpec = serde_json::from_str(planes).expect("a network");
    let clouds = |n: usize| PointBatch::new(vec![[0.0; 3]; 2 * n], vec![2; n]).expect("valid");
    assert!(spec.plan(clouds(1), 0).is_ok() && spec.plan(clouds(9), 0).is_err(), "planes of 4 million cells each");
    for (positions, lengths) in
        [(vec![[0.0; 3]], vec![2]), (vec![[0.0; 3]], vec![1, 0]), (vec![[f32::NAN; 3]], vec![1])]
    {
        assert!(PointBatch::new(positions, lengths).is_err());
    }
}

#[test]
fn smallest_clouds_run_through_every_network() {
    for text in NETWORKS {
        let spec: PointNetworkSpec = serde_json::from_str(text).expect("a network");
        let parameters = Parameters::random(&spec.parameters(), &mut Random::new(2)).expect("a start");
        for n in [1, 2, 3] {
            let batch = PointBatch::new(vec![[3.0, -2.0, 1e6]; n], vec![n]).expect("valid");
            let features = Tensor::zeros((n, 4), candle_core::DType::F32, &Device::Cpu).expect("zeros");
            let Ok(plan) = spec.plan(batch, 1) else {
                assert!(n == 1 && text.contains("waffle_iron"), "{text}");
                continue;
            };
            let scores = spec.run(&mut Pass::evaluation(&parameters), &plan, &features).expect("runs");
            let scores = scores.to_vec2::<f32>().expect("rows");
            assert!(scores.len() == n && scores.iter().flatten().all(|score| score.is_finite()), "{text}");
        }
    }
}
