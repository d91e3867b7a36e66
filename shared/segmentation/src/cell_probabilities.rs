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
    /// The probabilities at each point, in order; `None` if they are unknown.
    pub(crate) fn per_point(&self) -> impl Iterator<Item = Option<&[f32]>> {
        let of_cell = |cell: u32| &self.of_cells[cell as usize * self.n_classes..][..self.n_classes];
        let known = move |&cell: &u32| (cell != NO_CELL).then(|| of_cell(cell)).filter(|row| is_known(row));
        self.cell_of_point.iter().map(known)
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
