//! Gradients of the operations on points compared with finite differences.

use candle_core::{Device, Result, Tensor, Var};
use kernels::points::{
    Activation, ColumnStatistics, KernelPoints, Lists, Neighborhood, Normalization, PlaneShape, Source, add_activated,
    concatenate, depth_wise_convolution, kernel_point_convolution, linear, maximum, normalize, plane_convolution,
    weighted_sum,
};
use random::Random;
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
        let statistics = ColumnStatistics::from_rows(&t[0])?;
        let by = Normalization { statistics: &statistics, source: Source::Rows, epsilon: 1e-5 };
        normalize(&t[0], by, &t[1], &t[2], Activation::NONE)
    };
    assert_gradients(&inputs, 1e-2, 3e-3, of_rows);
    let constant = ColumnStatistics { n_rows: 0, means: vec![0.1, -0.2, 0.3], variances: vec![0.5, 2.0, 1.0] };
    let by = Normalization { statistics: &constant, source: Source::Constant, epsilon: 1e-5 };
    let of_constants = |t: &[Tensor]| normalize(&t[0], by, &t[1], &t[2], Activation::NONE);
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
    let queries = positions(4);
    let support = positions(6);
    let kernel = positions(17);
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
