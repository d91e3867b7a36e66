//! Converts decisions to rows of topic `class`.

use messages::{ClassId, ClassRow};

/// Writes the row of each point. Returns the number of unlabeled points.
pub(crate) fn write_rows(rows: impl Iterator<Item = ClassRow>, classes: &mut [ClassRow]) -> usize {
    let mut n_unlabeled = 0;
    for (class, row) in classes.iter_mut().zip(rows) {
        *class = row;
        n_unlabeled += usize::from(row.class_id == ClassId::Unlabeled as u8);
    }
    n_unlabeled
}

/// The row of a point without a class.
pub(crate) const UNLABELED: ClassRow = ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 };

/// The row of a point from its class and the probability of the class, 0 to 1.
pub(crate) fn class_row(class: ClassId, probability: f32) -> ClassRow {
    ClassRow { class_id: class as u8, score: (probability * 255.0).round() as u8 }
}
