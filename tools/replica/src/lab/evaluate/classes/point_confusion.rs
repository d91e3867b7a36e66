//! Confusion matrices of points.

use messages::ClassId;
use scores::Confusion;
use std::path::Path;

/// The confusion matrix of the points whose true class is scored.
pub fn point_confusion(truth: &[u8], predicted: &[u8], is_scored: impl Fn(u8) -> bool) -> Confusion {
    let mut confusion = Confusion::new(ClassId::ALL.len());
    for (truth, predicted) in truth.iter().zip(predicted) {
        if is_scored(*truth) {
            confusion.add(usize::from(*truth), usize::from(*predicted));
        }
    }
    confusion
}

/// The file name without its extension.
pub fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
