//! Gradients of the operations and networks on points against finite differences, and results against the number of threads.

use candle_core::{Device, Result, Tensor, Var};
use random::Random;
use segmentation::points::ops::{
    Activation, ColumnStatistics, KernelPoints, Lists, Neighborhood, PlaneShape, Source, add_activated, concatenate,
    depth_wise_convolution, kernel_point_convolution, linear, maximum, normalize, plane_convolution, weighted_sum,
};
use segmentation::points::{Parameters, Pass, PointBatch, PointNetworkSpec};
use std::sync::Arc;

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

/// Compares the gradient of each element of each input with a central difference.
fn assert_gradients(inputs: &[Tensor], step: f32, tolerance: f64, f: impl Fn(&[Tensor]) -> Result<Tensor>) {
    let variables: Vec<Var> = inputs.iter().map(|input| Var::from_tensor(input).expect("f32")).collect();
    let tensors: Vec<Tensor> = variables.iter().map(|variable| variable.as_tensor().clone()).collect();
    let gradients = loss_tensor(&f(&tensors).expect("runs")).backward().expect("has gradients");
    for (i, input) in inputs.iter().enumerate() {
        let gradient = gradients.get(&tensors[i]).expect("reaches each input");
        let gradient = gradient.flatten_all().and_then(|values| values.to_vec1::<f32>()).expect("f32");
        let largest = gradient.iter().fold(1e-3_f32, |largest, value| largest.max(value.abs()));
        let values = input.flatten_all().and_then(|values| values.to_vec1::<f32>()).expect("f32");
        for (element, gradient) in gradient.iter().enumerate() {
            let at = |offset: f32| {
                let mut values = values.clone();
                values[element] += offset;
                let mut moved = inputs.to_vec();
                moved[i] = Tensor::from_vec(values, input.dims(), &Device::Cpu).expect("same shape");
                loss_of(&f(&moved).expect("runs"))
            };
            let difference = (at(step) - at(-step)) / f64::from(2.0 * step);
            let error = (difference - f64::from(*gradient)).abs();
            assert!(error <= tolerance * f64::from(largest), "input {i} [{element}]: {gradient} for {difference}");
        }
    }
}

#[test]
fn linear_gradient_equals_finite_difference() {
    let mut random = Random::new(1);
    let inputs = [gauss(&mut random, &[5, 7]), gauss(&mut random, &[4, 7]), gauss(&mut random, &[4])];
    assert_gradients(&inputs, 0.5, 1e-4, |t| linear(&t[0], &t[1], &t[2], Activation::NONE));
    // Far from 0 on both sides, so that no step crosses the bend.
    let bias = Tensor::new(&[40.0_f32, -40.0, 45.0, -50.0], &Device::Cpu).expect("a list");
    let inputs = [inputs[0].clone(), inputs[1].clone(), bias];
    assert_gradients(&inputs, 0.5, 1e-3, |t| linear(&t[0], &t[1], &t[2], Activation::LEAKY));
}

#[test]
fn concatenation_gradient_equals_finite_difference() {
    let mut random = Random::new(9);
    let inputs = [gauss(&mut random, &[5, 3]), gauss(&mut random, &[5, 1]), gauss(&mut random, &[5, 4])];
    let joined = concatenate(&inputs[0], &[&inputs[1], &inputs[2]]).expect("runs");
    let expected = Tensor::cat(&inputs, 1).expect("runs").to_vec2::<f32>().expect("rows");
    assert_eq!(joined.to_vec2::<f32>().expect("rows"), expected);
    assert_gradients(&inputs, 0.5, 1e-4, |t| concatenate(&t[0], &[&t[1], &t[2]]));
}

#[test]
fn weighted_sum_gradient_equals_finite_difference() {
    let mut random = Random::new(2);
    let lists = Arc::new(Lists::new([vec![2, 0], vec![], vec![1, 1, 3]], 5));
    let weights = Arc::new(vec![0.5, -1.0, 2.0, 0.25, 1.5]);
    let input = [gauss(&mut random, &[5, 3])];
    assert_gradients(&input, 0.5, 1e-4, |t| weighted_sum(&t[0], &lists, Some(&weights)));
    assert_gradients(&input, 0.5, 1e-4, |t| weighted_sum(&t[0], &lists, None));
}

#[test]
fn maximum_gradient_equals_finite_difference() {
    // Values at least 0.1 apart from each other and from 0.
    let order = Random::new(3).permutation(15);
    let values: Vec<f32> = order.into_iter().map(|rank| 0.1 * rank as f32 - 0.75).collect();
    let input = [Tensor::from_vec(values, (5, 3), &Device::Cpu).expect("shape of the values")];
    let lists = Arc::new(Lists::new([vec![2, 0, 4], vec![3], vec![], vec![1, 1, 0]], 5));
    assert_gradients(&input, 0.04, 1e-3, |t| maximum(&t[0], &lists, 0));
    assert_gradients(&input, 0.04, 1e-3, |t| maximum(&t[0], &lists, 3));
}

#[test]
fn first_of_equal_values_gets_the_gradient_of_the_maximum() {
    let rows = Var::from_vec(vec![1.0_f32, 1.0, 1.0], (3, 1), &Device::Cpu).expect("shape of the values");
    let lists = Arc::new(Lists::new([vec![2, 0, 1, 2]], 3));
    let maximum = maximum(&rows, &lists, 0).expect("runs");
    let gradients = maximum.sum_all().and_then(|sum| sum.backward()).expect("has gradients");
    let gradient = gradients.get(&rows).expect("reaches the input").flatten_all().and_then(|g| g.to_vec1::<f32>());
    assert_eq!(gradient.expect("f32"), [0.0, 0.0, 1.0]);
}

#[test]
fn normalization_gradient_equals_finite_difference() {
    let mut random = Random::new(4);
    let inputs = [gauss(&mut random, &[6, 3]), gauss(&mut random, &[3]), gauss(&mut random, &[3])];
    let of_rows = |t: &[Tensor]| {
        let statistics = ColumnStatistics::of(&t[0])?;
        normalize(&t[0], (&statistics, Source::Rows), 1e-5, &t[1], &t[2], Activation::NONE)
    };
    assert_gradients(&inputs, 1e-2, 3e-3, of_rows);
    let constant = ColumnStatistics { n_rows: 0, means: vec![0.1, -0.2, 0.3], variances: vec![0.5, 2.0, 1.0] };
    let of_constants =
        |t: &[Tensor]| normalize(&t[0], (&constant, Source::Constant), 1e-5, &t[1], &t[2], Activation::NONE);
    assert_gradients(&inputs, 0.5, 1e-4, of_constants);
}

#[test]
fn activated_sum_gradient_equals_finite_difference() {
    // Sums at least 0.2 from 0.
    let a = Tensor::new(&[[0.5_f32, -0.5, 1.0], [-1.0, 0.2, -0.2]], &Device::Cpu).expect("rows");
    let b = Tensor::new(&[[0.1_f32, 0.1, -3.0], [0.2, 0.3, -0.4]], &Device::Cpu).expect("rows");
    for activation in [Activation::NONE, Activation::RELU, Activation::LEAKY] {
        assert_gradients(&[a.clone(), b.clone()], 0.05, 1e-4, |t| add_activated(&t[0], &t[1], activation));
    }
}

#[test]
fn kernel_point_convolution_gradient_equals_finite_difference() {
    let mut random = Random::new(5);
    let mut positions = |n: usize| (0..n).map(|_| std::array::from_fn(|_| random.range(-1.0, 1.0))).collect::<Vec<_>>();
    let (queries, support, kernel) = (positions(4), positions(6), positions(17));
    let lists = Lists::new([vec![0, 3, 5], vec![1], vec![], vec![2, 1, 0, 4]], 6);
    let at = Neighborhood { queries: Arc::new(queries), support: Arc::new(support), lists: Arc::new(lists) };
    let kernel = KernelPoints::new(&kernel, 0.9);
    let inputs = [gauss(&mut random, &[6, 3]), gauss(&mut random, &[17, 3, 4]), gauss(&mut random, &[4])];
    let convolution = |t: &[Tensor]| kernel_point_convolution(&t[0], &t[1], &t[2], &at, &kernel, Activation::NONE);
    assert_gradients(&inputs, 0.5, 1e-4, convolution);
}

#[test]
fn plane_convolution_gradients_equal_finite_differences() {
    let mut random = Random::new(6);
    let shape = PlaneShape { planes: 2, height: 3, width: 4 };
    let cells = gauss(&mut random, &[24, 3]);
    let dense = [cells.clone(), gauss(&mut random, &[2, 3, 3, 3]), gauss(&mut random, &[2])];
    assert_gradients(&dense, 0.5, 1e-4, |t| plane_convolution(&t[0], &t[1], &t[2], shape, Activation::NONE));
    let depth_wise = [cells, gauss(&mut random, &[3, 1, 3, 3]), gauss(&mut random, &[3])];
    assert_gradients(&depth_wise, 0.5, 1e-4, |t| depth_wise_convolution(&t[0], &t[1], &t[2], shape, Activation::NONE));
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
    // PointNet normalizes one row for each cloud: of few clouds, a finite difference would need smaller steps than f32 has.
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
