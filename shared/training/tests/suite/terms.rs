//! Derivatives of the additional loss terms, compared with central differences of a reference in f64: consistency of a
//! sparse view, and the head on the bird's-eye view.

use crate::gradients::{MAX_ERROR, relative_error};
use crate::reference::{Image, Values, numbers, run_to_features};
use kernels::images::{Border, Planes};
use random::Random;
use segmentation::network::NetworkSpec;
use training::{
    BevHead, BevLabels, Criterion, Derivatives, Example, ImageNetwork, Loss, NO_CELL, Network, SparseView, UNKNOWN,
    Variables,
};

const CLASSES: usize = 3;
const FOLD: usize = 2;
const INPUTS: usize = 4;
/// Rows and columns of the network, for the sweep and its sparse view.
const FULL: [usize; 2] = [4, 8];
const SPARSE: [usize; 2] = [2, 8];
const SIDE: usize = 5;
const CONSISTENCY: f64 = 0.7;
const BEV: f64 = 0.4;
/// Channels of the last layer before the classes.
const FEATURES: usize = 20;

fn spec() -> NetworkSpec {
    NetworkSpec::Unet { inputs: INPUTS, outputs: CLASSES * FOLD, widths: vec![16, 20], head: Some(FEATURES) }
}

fn noise([height, width]: [usize; 2], random: &mut Random) -> Image {
    let mut image = Image::zeros(INPUTS, height, width);
    image.values.iter_mut().for_each(|value| *value = f64::from(random.gauss()));
    image
}

/// Inputs of an example and of its sparse view, and the labels.
struct Case {
    full: Image,
    sparse: Image,
    truth: Vec<u8>,
    pixels: Vec<[u32; 2]>,
    cells: Vec<u32>,
    of_cells: Vec<u8>,
}

fn case() -> Case {
    let mut random = Random::new(4);
    let n = FULL[0] * FULL[1] * FOLD;
    let mut class = |share: f32| if random.chance(share) { UNKNOWN } else { random.index(CLASSES) as u8 };
    let truth = (0..n).map(|_| class(0.2)).collect();
    let of_cells = (0..SIDE * SIDE).map(|_| class(0.3)).collect();
    let of_row = SPARSE[1] * FOLD;
    // Every second row, without some pixels.
    let pixels = (0..SPARSE[0] * of_row).filter(|i| i % 7 > 1).map(|i| [i, i + (i / of_row + 1) * of_row]);
    let pixels = pixels.map(|pair| pair.map(|i| i as u32)).collect();
    let cells = (0..n).map(|i| if i % 6 == 0 { NO_CELL } else { random.index(SIDE * SIDE) as u32 }).collect();
    Case { full: noise(FULL, &mut random), sparse: noise(SPARSE, &mut random), truth, pixels, cells, of_cells }
}

fn planes(image: &Image) -> Planes {
    let value = |channel, y, x| image.values[image.index(channel, y, x)] as f32;
    Planes::from_fn([image.channels, image.height, image.width], Border::Circular, value)
}

/// Logarithms of the probabilities at a pixel.
fn log_p(output: &Image, pixel: usize, fold: usize) -> Vec<f64> {
    let row = pixel / (output.width * fold);
    let column = pixel % (output.width * fold);
    let first = column % fold * CLASSES;
    let logits: Vec<f64> =
        (first..first + CLASSES).map(|c| output.values[output.index(c, row, column / fold)]).collect();
    let log_sum = logits.iter().map(|logit| logit.exp()).sum::<f64>().ln();
    logits.iter().map(|logit| logit - log_sum).collect()
}

/// Mean cross-entropy of the labeled pixels.
fn cross_entropy(output: &Image, truth: &[u8], fold: usize) -> f64 {
    let known: Vec<usize> = (0..truth.len()).filter(|&pixel| truth[pixel] != UNKNOWN).collect();
    let of_pixel = |&pixel: &usize| -log_p(output, pixel, fold)[usize::from(truth[pixel])];
    known.iter().map(of_pixel).sum::<f64>() / known.len() as f64
}

/// Mean features of the pixels in each cell.
fn grid(case: &Case, features: &Image) -> Image {
    let mut grid = Image::zeros(FEATURES, SIDE, SIDE);
    for cell in 0..SIDE * SIDE {
        let pixels: Vec<usize> = (0..case.cells.len()).filter(|&pixel| case.cells[pixel] as usize == cell).collect();
        for channel in 0..FEATURES {
            let value = |&pixel: &usize| {
                let row = pixel / (FULL[1] * FOLD);
                let column = pixel % (FULL[1] * FOLD);
                features.values[features.index(channel, row, column / FOLD)]
            };
            let at = grid.index(channel, cell / SIDE, cell % SIDE);
            grid.values[at] = pixels.iter().map(value).sum::<f64>() / pixels.len().max(1) as f64;
        }
    }
    grid
}

/// Variables of the head, with their names in the head.
fn head_variables(values: &Values) -> Values {
    let of_head = values.iter().filter_map(|(name, of)| Some((name.strip_prefix("bev_head.")?.to_owned(), of.clone())));
    of_head.collect()
}

/// The loss by its definition; with the values `constant`, the full view is a constant.
fn reference_loss(case: &Case, values: &Values, constant: &Values) -> f64 {
    let run = |values: &Values, input: &Image| run_to_features(&spec(), values, input.clone(), Border::Circular);
    let [features, output] = run(values, &case.full);
    let [_, of_sparse] = run(values, &case.sparse);
    let [_, of_full] = run(constant, &case.full);
    let divergence = |&[sparse, full]: &[u32; 2]| {
        let [log_q, log_p] = [log_p(&of_sparse, sparse as usize, FOLD), log_p(&of_full, full as usize, FOLD)];
        log_p.iter().zip(log_q).map(|(log_p, log_q)| log_p.exp() * (log_p - log_q)).sum::<f64>()
    };
    let consistency = case.pixels.iter().map(divergence).sum::<f64>() / case.pixels.len() as f64;
    let head = NetworkSpec::Unet { inputs: FEATURES, outputs: CLASSES, widths: vec![32], head: None };
    let [_, of_cells] = run_to_features(&head, &head_variables(values), grid(case, &features), Border::Zero);
    cross_entropy(&output, &case.truth, FOLD)
        + CONSISTENCY * consistency
        + BEV * cross_entropy(&of_cells, &case.of_cells, 1)
}

/// The derivatives computed by the crate, and the values of all variables.
fn derived(case: &Case) -> (Derivatives, Values) {
    let sparse = SparseView { input: planes(&case.sparse), pixels: case.pixels.clone() };
    let bev = BevLabels { side: SIDE, cells: case.cells.clone(), truth: case.of_cells.clone() };
    let example = Example::new(planes(&case.full), case.truth.clone());
    let example = Example { sparse_view: Some(sparse), bev: Some(bev), ..example };
    let variables = Variables::random(&spec(), 3).expect("variables");
    let head = BevHead::random(FEATURES, CLASSES, 5).expect("a head");
    let mut network = ImageNetwork::new(variables, FOLD, Border::Circular).with_bev_head(head);
    let values = network.variables().iter().map(|(name, var)| (name.clone(), numbers(var))).collect();
    let criterion = Criterion::new(Loss::CrossEntropy, None, CLASSES, 0).with_terms(CONSISTENCY, BEV);
    let derivatives = network.derive(&[example], &criterion, Random::new(1)).expect("derives").expect("is labeled");
    (derivatives, values)
}

#[test]
fn derivatives_with_consistency_and_bev_head_equal_central_differences_in_f64() {
    let case = case();
    let (Derivatives { loss, gradients }, values) = derived(&case);
    let expected = reference_loss(&case, &values, &values);
    assert!((loss - expected).abs() < 1e-5 * expected, "{loss} for {expected}");
    assert_eq!(gradients.len(), values.len());
    assert!(gradients.contains_key("bev_head.classes.bias") && gradients.contains_key("classes.bias"));
    for (name, gradient) in &gradients {
        let error = relative_error(|moved| reference_loss(&case, moved, &values), &values, name, gradient);
        assert!(error < MAX_ERROR, "{name}: relative error {error:.1e}");
    }
}

/// Without the constant, the full view would follow the sparse one.
#[test]
fn full_view_does_not_follow_sparse_view() {
    let case = case();
    let (Derivatives { gradients, .. }, values) = derived(&case);
    let name = "down.0.0.raw";
    let error = relative_error(|moved| reference_loss(&case, moved, moved), &values, name, &gradients[name]);
    assert!(error > 10.0 * MAX_ERROR, "relative error {error:.1e}");
}

#[test]
fn example_without_labeled_cells_has_no_loss_of_the_head() {
    let loss = |cell_class: u8, bev_head: f64| {
        let case = case();
        let bev = BevLabels { side: SIDE, cells: case.cells.clone(), truth: vec![cell_class; SIDE * SIDE] };
        let example = Example { bev: Some(bev), ..Example::new(planes(&case.full), case.truth.clone()) };
        let variables = Variables::random(&spec(), 3).expect("variables");
        let head = BevHead::random(FEATURES, CLASSES, 5).expect("a head");
        let mut network = ImageNetwork::new(variables, FOLD, Border::Circular).with_bev_head(head);
        let criterion = Criterion::new(Loss::CrossEntropy, None, CLASSES, 0).with_terms(0.0, bev_head);
        network.derive(&[example], &criterion, Random::new(1)).expect("derives").expect("is labeled").loss
    };
    assert!(loss(UNKNOWN, 1.0) == loss(UNKNOWN, 0.0) && loss(1, 1.0) > loss(1, 0.0));
}
