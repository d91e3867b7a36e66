//! Losses compared with their formulas and with central differences in f64.

use candle_core::{Device, Tensor, Var};
use messages::ClassId;
use random::Random;
use training::{Hierarchy, Loss, consistency};

const CLASSES: usize = 6;

fn all() -> Vec<Loss> {
    vec![
        Loss::CrossEntropy,
        Loss::WeightedCrossEntropy { weights: vec![1.0, 2.0, 0.5, 4.0, 1.5, 0.7] },
        Loss::Focal { gamma: 2.0 },
        Loss::Dice,
        Loss::Tversky { alpha: 0.3, beta: 0.7 },
        Loss::Jaccard,
        Loss::PowerJaccard { power: 1.5 },
        Loss::PowerJaccard { power: 2.0 },
        Loss::CrossEntropyPowerJaccard { power: 1.75 },
        Loss::WeightedCrossEntropyPowerJaccard { weights: vec![1.0, 2.0, 0.5, 4.0, 1.5, 0.7], power: 1.75 },
    ]
}

/// Logits and one-hot labels of 40 pixels; every eighth is unlabeled.
fn pixels(random: &mut Random) -> (Vec<f64>, Vec<f64>) {
    let logits = (0..40 * CLASSES).map(|_| f64::from(random.range(-3.0, 3.0))).collect();
    let class: Vec<usize> = (0..40).map(|_| (random.unit() * CLASSES as f32) as usize).collect();
    let truth = |i: usize| f64::from(u8::from(!(i / CLASSES).is_multiple_of(8) && class[i / CLASSES] == i % CLASSES));
    (logits, (0..40 * CLASSES).map(truth).collect())
}

fn matrix(values: &[f64]) -> Tensor {
    Tensor::from_slice(values, (values.len() / CLASSES, CLASSES), &Device::Cpu).expect("a matrix")
}

fn value(loss: &Tensor) -> f64 {
    loss.to_scalar::<f64>().expect("a number")
}

/// Largest difference of the derivative from central differences, over all logits.
fn gradient_error(of: &dyn Fn(&Tensor, &Tensor) -> Tensor, logits: &[f64], truth: &[f64]) -> (f64, f64) {
    let truth = matrix(truth);
    let var = Var::from_tensor(&matrix(logits)).expect("a variable");
    let gradients = of(var.as_tensor(), &truth).backward().expect("derives");
    let gradient = gradients.get(&var).expect("a derivative").flatten_all().expect("flat");
    let gradient = gradient.to_vec1::<f64>().expect("numbers");
    let step = 1e-5;
    let mut worst = 0.0_f64;
    for (i, got) in gradient.iter().enumerate() {
        let moved = |by: f64| {
            let mut logits = logits.to_vec();
            logits[i] += by;
            value(&of(&matrix(&logits), &truth))
        };
        worst = worst.max((got - (moved(step) - moved(-step)) / (2.0 * step)).abs());
    }
    (worst, gradient.iter().fold(0.0_f64, |largest, g| largest.max(g.abs())))
}

#[test]
fn loss_derivatives_equal_central_differences() {
    let (logits, truth) = pixels(&mut Random::new(1));
    let tree = Hierarchy::new(vec![0, 0, 1, 1, 2, 3]);
    for loss in all() {
        let flat = |logits: &Tensor, y: &Tensor| loss.forward(logits, y).expect("a loss");
        let deep = |logits: &Tensor, y: &Tensor| loss.forward_hierarchy(logits, y, &tree).expect("a loss");
        for (error, size) in [gradient_error(&flat, &logits, &truth), gradient_error(&deep, &logits, &truth)] {
            assert!(size > 1e-3, "{loss:?}: no derivative");
            assert!(error < 1e-8, "{loss:?}: off by {error} of {size}");
        }
    }
}

#[test]
fn consistency_derivatives_equal_central_differences() {
    let mut random = Random::new(7);
    let [(full, _), (sparse, _)] = [(); 2].map(|()| pixels(&mut random));
    // The second argument of the check is a constant.
    let of_sparse = |sparse: &Tensor, full: &Tensor| consistency(full, sparse).expect("a divergence");
    let (error, size) = gradient_error(&of_sparse, &sparse, &full);
    assert!(size > 1e-3 && error < 1e-8, "off by {error} of {size}");
    assert!(value(&of_sparse(&matrix(&sparse), &matrix(&full))) > 0.1);
    assert!(value(&of_sparse(&matrix(&full), &matrix(&full))).abs() < 1e-12, "equal views");
    let full = Var::from_tensor(&matrix(&full)).expect("a variable");
    let divergence = of_sparse(&matrix(&sparse), &full);
    assert!(divergence.backward().expect("derives").get(&full).is_none(), "the full view is a constant");
}

#[test]
fn pixels_without_label_are_ignored() {
    let (logits, truth) = pixels(&mut Random::new(2));
    let tree = Hierarchy::new(vec![0, 0, 1, 1, 2, 3]);
    let mut other = logits.clone();
    for (i, logit) in other.iter_mut().enumerate() {
        if (i / CLASSES).is_multiple_of(8) {
            *logit = -*logit + 1.0;
        }
    }
    for loss in all() {
        let of =
            |logits: &[f64]| value(&loss.forward_hierarchy(&matrix(logits), &matrix(&truth), &tree).expect("a loss"));
        assert!((of(&logits) - of(&other)).abs() < 1e-12, "{loss:?}");
    }
}

#[test]
fn correct_prediction_has_lowest_loss() {
    let (_, truth) = pixels(&mut Random::new(3));
    let sure: Vec<f64> = truth.iter().map(|y| 40.0 * y).collect();
    let wrong: Vec<f64> =
        sure.iter().enumerate().map(|(i, _)| sure[i / CLASSES * CLASSES + (i + 1) % CLASSES]).collect();
    for loss in all() {
        let of = |logits: &[f64]| value(&loss.forward(&matrix(logits), &matrix(&truth)).expect("a loss"));
        let best = of(&sure);
        let unsure = of(&vec![0.0; sure.len()]);
        let worst = of(&wrong);
        assert!(best.abs() < 1e-3, "{loss:?}: {best}");
        assert!(best < unsure && unsure < worst, "{loss:?}: {best} {unsure} {worst}");
    }
}

#[test]
fn special_cases_of_losses_agree() {
    let (logits, truth) = pixels(&mut Random::new(4));
    let of = |loss: Loss| value(&loss.forward(&matrix(&logits), &matrix(&truth)).expect("a loss"));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    near(of(Loss::PowerJaccard { power: 1.0 }), of(Loss::Jaccard));
    near(of(Loss::Tversky { alpha: 1.0, beta: 1.0 }), of(Loss::Jaccard));
    near(of(Loss::Tversky { alpha: 0.5, beta: 0.5 }), of(Loss::Dice));
    near(of(Loss::Focal { gamma: 0.0 }), of(Loss::CrossEntropy));
    near(of(Loss::WeightedCrossEntropy { weights: vec![3.0; CLASSES] }), of(Loss::CrossEntropy));
    let both = of(Loss::CrossEntropy) + of(Loss::PowerJaccard { power: 1.5 });
    near(of(Loss::CrossEntropyPowerJaccard { power: 1.5 }), both);
    near(of(Loss::WeightedCrossEntropyPowerJaccard { weights: vec![3.0; CLASSES], power: 1.5 }), both);
}

/// The probability p that minimizes `J_p` for many pixels of one class with equal p (thesis section 5.5.3).
fn minimum_at(power: f64) -> f64 {
    let n = 100_000.0;
    let loss = |p: f64| {
        // With 100 000 pixels, the epsilon of the loss (one pixel) is negligible.
        let both = n * p;
        1.0 - (both + 1.0) / (n + n * p.powf(power) - both + 1.0)
    };
    let at = |i: u32| f64::from(i) / 10_000.0;
    (0..=10_000).map(at).min_by(|a, b| loss(*a).total_cmp(&loss(*b))).expect("not empty")
}

#[test]
fn power_jaccard_has_minimum_of_thesis() {
    for power in [1.25, 1.5, 1.75, 2.0] {
        assert!((minimum_at(power) - 1.0).abs() < 1e-3, "{power}: {}", minimum_at(power));
    }
    for power in [2.5_f64, 3.0, 5.0] {
        let expected = (1.0 / (power - 1.0)).powf(1.0 / power);
        assert!((minimum_at(power) - expected).abs() < 1e-3, "{power}: {} for {expected}", minimum_at(power));
        assert!(expected < 0.96);
    }
}

/// The loss itself has the same minimum: for a power above 2, certainty costs more than near certainty.
#[test]
fn power_above_two_penalizes_certainty() {
    let n = 4000;
    let truth: Vec<f64> =
        (0..n).flat_map(|i| (0..CLASSES).map(move |c| f64::from(u8::from(c == i % CLASSES)))).collect();
    let of = |power: f64, logit: f64| {
        let logits: Vec<f64> = truth.iter().map(|y| logit * y).collect();
        value(&Loss::PowerJaccard { power }.forward(&matrix(&logits), &matrix(&truth)).expect("a loss"))
    };
    let nearly = 4.0;
    let sure = 40.0;
    assert!(of(3.0, nearly) < of(3.0, sure));
    assert!(of(2.0, nearly) > of(2.0, sure));
    assert!(of(1.5, nearly) > of(1.5, sure));
}

/// A power that training may also change therefore ends at its upper limit, whatever the data.
#[test]
fn power_jaccard_never_rises_with_its_power() {
    let mut random = Random::new(11);
    for _ in 0..20 {
        let (logits, truth) = pixels(&mut random);
        let of_power = |power: f64| {
            let loss = Loss::PowerJaccard { power }.forward(&matrix(&logits), &matrix(&truth)).expect("a loss");
            value(&loss)
        };
        let losses: Vec<f64> = (0..=20).map(|i| of_power(1.0 + 0.1 * f64::from(i))).collect();
        assert!(losses.windows(2).all(|pair| pair[1] < pair[0]), "{losses:?}");
    }
}

#[test]
fn class_tree_equals_figure_6_11() {
    use ClassId::{Building, Pole, Road, RoadLine, TrafficLight, Vegetation};
    let node = Hierarchy::node_name;
    assert_eq!((node(Road), node(RoadLine)), (Some("rideable"), Some("rideable")));
    assert_eq!((node(Pole), node(TrafficLight)), (Some("vertical"), Some("vertical")));
    assert_eq!(node(ClassId::Unlabeled), None);
    let n_in_tree = ClassId::ALL.iter().filter(|class| node(**class).is_some()).count();
    assert_eq!(n_in_tree, 19);
    // Confusing classes of one node costs less than confusing classes of different nodes.
    let classes = [Road, RoadLine, Building, Vegetation, Pole, TrafficLight];
    let tree = Hierarchy::from_classes(&classes);
    let truth = matrix(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let cost = |predicted: usize| {
        let logits: Vec<f64> = (0..CLASSES).map(|c| if c == predicted { 9.0 } else { 0.0 }).collect();
        value(&Loss::CrossEntropy.forward_hierarchy(&matrix(&logits), &truth, &tree).expect("a loss"))
    };
    assert!(cost(0) < cost(1) && cost(1) + 1.0 < cost(2));
}
