//! Start of a training from a model with other classes: outputs of the last layer are matched by the name of their class.

use segmentation::network::{WeightTensor, Weights};

/// The last layer of a network.
#[derive(Clone, Copy, Debug)]
pub struct ClassLayer<'a> {
    /// Names of its tensors: weights, then biases. Both have one row per output.
    pub tensors: [&'a str; 2],
    /// Names of the classes in the order of the outputs.
    pub classes: &'a [String],
    /// Columns that the network folds into one: output `column * classes + class` is the output of a class at a folded
    /// column.
    pub fold: usize,
}

impl ClassLayer<'_> {
    /// Removes its tensors from weights.
    fn take(&self, weights: &mut Weights) -> [Option<WeightTensor>; 2] {
        self.tensors.map(|name| weights.tensors.remove(name))
    }
}

/// Replaces the last layer in `start`, the weights of another model, by a layer for the `own` classes. Outputs of classes
/// that `start` also has get its rows. Outputs of other classes get the rows of `random`, the weights of the own network
/// before the training. Returns the number of classes that both models have.
///
/// If no class matches, or the layers differ in their inputs, names or folded columns, `start` has no last layer
/// afterwards. A class therefore never gets the rows of another class.
pub fn match_classes(start: &mut Weights, of_start: ClassLayer<'_>, random: &Weights, own: ClassLayer<'_>) -> usize {
    let [taken, _] = [of_start.take(start), own.take(start)];
    let source_of: Vec<Option<usize>> =
        own.classes.iter().map(|name| of_start.classes.iter().position(|of| of == name)).collect();
    let n_shared = source_of.iter().flatten().count();
    if n_shared == 0 || of_start.tensors != own.tensors || of_start.fold != own.fold {
        return 0;
    }
    let mut matched = Vec::new();
    for (name, taken) in own.tensors.into_iter().zip(taken) {
        let (Some(taken), Some(random)) = (taken, random.tensors.get(name)) else { return 0 };
        let has_rows = |shape: &[usize], of: &ClassLayer<'_>| shape.first() == Some(&(of.fold * of.classes.len()));
        let has_all_rows = has_rows(&taken.shape, &of_start) && has_rows(&random.shape, &own);
        if !has_all_rows || taken.shape[1..] != random.shape[1..] {
            return 0;
        }
        let mut values = random.values.clone();
        let n_row: usize = taken.shape[1..].iter().product();
        for (row, values) in values.chunks_exact_mut(n_row).enumerate() {
            let column = row / own.classes.len();
            let class = row % own.classes.len();
            if let Some(source) = source_of[class] {
                let row = column * of_start.classes.len() + source;
                values.copy_from_slice(&taken.values[row * n_row..][..n_row]);
            }
        }
        matched.push((name.to_owned(), WeightTensor { shape: random.shape.clone(), values }));
    }
    start.tensors.extend(matched);
    n_shared
}
