//! Start from a model with other classes.

use segmentation::network::{NetworkSpec, Weights};
use training::{ClassLayer, Variables, match_classes};

const TENSORS: [&str; 2] = ["classes.weight", "classes.bias"];
const WIDTH: usize = 16;

fn names(classes: &[&str]) -> Vec<String> {
    classes.iter().map(|&name| name.to_owned()).collect()
}

fn variables(outputs: usize, seed: u64) -> Variables {
    let spec = NetworkSpec::Unet { inputs: 7, outputs, widths: vec![WIDTH, 20], head: None };
    Variables::random(&spec, seed).expect("variables")
}

/// Weights and bias of an output.
fn output(weights: &Weights, row: usize) -> (&[f32], f32) {
    let [values, biases] = TENSORS.map(|name| &weights.tensors[name].values);
    (&values[row * WIDTH..(row + 1) * WIDTH], biases[row])
}

/// Starts variables of `own` classes from the weights of a network that has its own biases.
fn begin(of_start: &[&str], own: &[&str], folds: [usize; 2]) -> (usize, Weights, Weights, Weights) {
    let of_start = names(of_start);
    let own = names(own);
    let mut start = variables(folds[0] * of_start.len(), 1).weights().expect("weights");
    let biases = start.tensors.get_mut(TENSORS[1]).expect("biases");
    biases.values.iter_mut().enumerate().for_each(|(row, bias)| *bias = row as f32);
    let variables = variables(folds[1] * own.len(), 2);
    let random = variables.weights().expect("weights");
    let mut matched = start.clone();
    let layer = |classes, fold| ClassLayer { tensors: TENSORS, classes, fold };
    let n_shared = match_classes(&mut matched, layer(&of_start, folds[0]), &random, layer(&own, folds[1]));
    variables.begin_with(&matched).expect("fits");
    (n_shared, start, random, variables.weights().expect("weights"))
}

fn is_near(a: (&[f32], f32), b: (&[f32], f32)) -> bool {
    a.0.len() == b.0.len() && a.0.iter().chain([&a.1]).zip(b.0.iter().chain([&b.1])).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn outputs_are_matched_by_class_name_in_all_folded_columns() {
    let (n_shared, start, random, begun) = begin(&["road", "wall", "pole"], &["pole", "fence", "road", "wall"], [2, 2]);
    assert_eq!(n_shared, 3);
    for column in 0..2 {
        for (class, source) in [(0, Some(2)), (1, None), (2, Some(0)), (3, Some(1))] {
            let own = output(&begun, column * 4 + class);
            let expected = source.map_or(output(&random, column * 4 + class), |of| output(&start, column * 3 + of));
            assert!(is_near(own, expected), "column {column} class {class}");
        }
    }
}

#[test]
fn equal_layer_with_classes_in_another_order_is_reordered() {
    let (n_shared, start, _, begun) = begin(&["road", "wall"], &["wall", "road"], [1, 1]);
    assert_eq!(n_shared, 2);
    assert!(is_near(output(&begun, 0), output(&start, 1)) && is_near(output(&begun, 1), output(&start, 0)));
    let (n_shared, start, _, begun) = begin(&["road", "wall"], &["road", "wall"], [1, 1]);
    assert_eq!(n_shared, 2);
    assert!((0..2).all(|row| is_near(output(&begun, row), output(&start, row))));
}

#[test]
fn layer_without_matching_classes_or_of_another_fold_starts_at_random() {
    for (of_start, own, folds) in
        [(["road", "wall"], vec!["pole", "fence"], [2, 2]), (["road", "wall"], vec!["road"], [1, 2])]
    {
        let (n_shared, _, random, begun) = begin(&of_start, &own, folds);
        assert_eq!(n_shared, 0);
        assert!((0..2).all(|row| is_near(output(&begun, row), output(&random, row))), "{own:?}");
    }
}
