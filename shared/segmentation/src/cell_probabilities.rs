//! Probabilities of the classes in the cells of a submap.

use crate::class_rows::{UNLABELED, class_row};
use messages::{ClassId, ClassRow};

/// Cell index of a point outside all cells.
pub(crate) const NO_CELL: u32 = u32::MAX;

/// The probabilities of the classes of a model in each cell of a submap, and the cells of its points.
pub struct CellProbabilities {
    n_classes: usize,
    of_cells: Vec<f32>,
    cell_of_point: Vec<u32>,
}

impl CellProbabilities {
    /// `of_cells` has `n_classes` probabilities for each cell, zeros if they are unknown; `cell_of_point` is the cell
    /// of each point, or [`NO_CELL`].
    pub(crate) fn new(n_classes: usize, of_cells: Vec<f32>, cell_of_point: Vec<u32>) -> Self {
        debug_assert!(of_cells.len().is_multiple_of(n_classes), "a row for each cell");
        Self { n_classes, of_cells, cell_of_point }
    }
    /// The probabilities at a point; `None` if they are unknown.
    pub(crate) fn at(&self, point: usize) -> Option<&[f32]> {
        let cell = self.cell_of_point[point];
        let row = (cell != NO_CELL).then(|| &self.of_cells[cell as usize * self.n_classes..][..self.n_classes]);
        row.filter(|row| is_known(row))
    }
    /// The row of a point that cannot have a class. `classes` are the classes of the probabilities.
    pub(crate) fn decide_without(&self, point: usize, class: ClassId, classes: &[ClassId]) -> ClassRow {
        row_of(self.at(point).and_then(|row| best_without(row, class, classes)), classes)
    }
    /// The probabilities at each point, in order; `None` if they are unknown.
    pub(crate) fn per_point(&self) -> impl Iterator<Item = Option<&[f32]>> {
        (0..self.cell_of_point.len()).map(|point| self.at(point))
    }
    /// Applies a function to all known probabilities.
    pub(crate) fn map(mut self, f: impl Fn(f32) -> f32) -> Self {
        for row in self.of_cells.chunks_exact_mut(self.n_classes) {
            if is_known(row) {
                for probability in row {
                    *probability = f(*probability);
                }
            }
        }
        self
    }
    /// Multiplies the probabilities of each class by a factor. Their sums stay the same.
    pub(crate) fn scaled(mut self, factors: &[f32]) -> Self {
        for row in self.of_cells.chunks_exact_mut(self.n_classes).filter(|row| is_known(row)) {
            let before: f32 = row.iter().sum();
            row.iter_mut().zip(factors).for_each(|(probability, factor)| *probability *= factor);
            let after: f32 = row.iter().sum();
            for probability in row {
                *probability *= before / after;
            }
        }
        self
    }
    /// Class and score of each point, in order. `classes` are the classes of the probabilities.
    pub(crate) fn decide(&self, classes: &[ClassId]) -> impl Iterator<Item = ClassRow> {
        let of_cell = |row: &[f32]| row_of(best_of(row), classes);
        let of_cells: Vec<ClassRow> = self.of_cells.chunks_exact(self.n_classes).map(of_cell).collect();
        self.cell_of_point.iter().map(move |&cell| of_cells.get(cell as usize).copied().unwrap_or(UNLABELED))
    }
}

/// Whether a cell has probabilities.
pub(crate) fn is_known(probabilities: &[f32]) -> bool {
    probabilities.iter().any(|probability| *probability > 0.0)
}

/// The most probable class of a point or cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BestClass {
    /// Index among the classes of the model.
    pub class: usize,
    /// Probability, 0 to 1.
    pub probability: f32,
}

/// The best class, the first one of equally probable classes; `None` if all probabilities are zero.
pub(crate) fn best_of(probabilities: &[f32]) -> Option<BestClass> {
    let mut best = BestClass { class: 0, probability: *probabilities.first()? };
    for (class, &probability) in probabilities.iter().enumerate() {
        if probability > best.probability {
            best = BestClass { class, probability };
        }
    }
    Some(best).filter(|best| best.probability > 0.0)
}

/// The best class other than `class`; `None` if no other is possible. Its probability is its share of all values.
pub(crate) fn best_without(probabilities: &[f32], class: ClassId, classes: &[ClassId]) -> Option<BestClass> {
    let mut others = [0.0; ClassId::ALL.len()];
    let others = &mut others[..probabilities.len()];
    others.copy_from_slice(probabilities);
    others.iter_mut().zip(classes).filter(|(_, of)| **of == class).for_each(|(value, _)| *value = 0.0);
    best_share_of(others)
}

/// The best class of values proportional to the probabilities, and its share of all values; `None` if all are zero.
pub(crate) fn best_share_of(values: &[f32]) -> Option<BestClass> {
    let total: f32 = values.iter().sum();
    best_of(values).map(|best| BestClass { probability: best.probability / total, ..best })
}

/// The row of a point with this class; unlabeled without a class.
pub(crate) fn row_of(best: Option<BestClass>, classes: &[ClassId]) -> ClassRow {
    best.map_or(UNLABELED, |BestClass { class, probability }| class_row(classes[class], probability))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_best_class_of_their_cell_and_of_equal_ones_the_first() {
        let classes = [ClassId::Road, ClassId::Pole];
        let cells = CellProbabilities::new(2, vec![0.25, 0.75, 0.5, 0.5, 0.0, 0.0], vec![1, 0, 0, 2, NO_CELL]);
        let row = |class: ClassId, score: u8| ClassRow { class_id: class as u8, score };
        let unlabeled = row(ClassId::Unlabeled, 0);
        let rows: Vec<ClassRow> = cells.decide(&classes).collect();
        let pole = row(ClassId::Pole, 191);
        assert_eq!(rows, [row(ClassId::Road, 128), pole, pole, unlabeled, unlabeled]);
        let known: Vec<Option<&[f32]>> = cells.per_point().collect();
        assert_eq!(known[1], Some([0.25, 0.75].as_slice()));
        assert_eq!(known[3..], [None, None]);
    }
}
