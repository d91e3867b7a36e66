//! Labels of SemanticKITTI, one file per sweep.

use super::sweeps::KittiSweeps;
use crate::error::{At, ImportError};
use crate::files::files;
use crate::numbered::number_of;
use crate::plan::Conversion;
use drive::is_return;
use files::regular_file;
use formats::kitti::{Label, bytes_from_labels, labels_from_bytes, points_from_bin};
use formats::semantic_kitti::class_of_label;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The label files of a drive: one for each label file of a sweep.
pub(crate) fn conversions(place: &Path, folder: &Path, sweeps: &KittiSweeps) -> Result<Vec<Conversion>, ImportError> {
    let seq_of_number: BTreeMap<usize, usize> =
        sweeps.numbers.iter().enumerate().map(|(seq, number)| (*number, seq)).collect();
    let mut conversions = Vec::new();
    for (name, labels) in files(folder, ".label")? {
        let number = number_of(&name, ".label", &labels)?;
        let Some(&seq) = seq_of_number.get(&number) else {
            return Err(ImportError::at(&labels, format!("there is no sweep with number {number}")));
        };
        let sweep = sweeps.sweeps.files[seq].1.clone();
        conversions.push(Conversion {
            place: place.join(format!("{seq:06}.label")),
            originals: vec![labels.clone()],
            content: Box::new(move || Ok(converted(&sweep, &labels)?.into())),
        });
    }
    if conversions.is_empty() {
        return Err(ImportError::at(folder, "has no *.label"));
    }
    Ok(conversions)
}

/// The labels of the points that are returns.
fn converted(sweep: &PathBuf, path: &PathBuf) -> Result<Vec<u8>, ImportError> {
    let points = points_from_bin(&regular_file::read(sweep).at(sweep)?).at(sweep)?;
    let labels = labels_from_bytes(&regular_file::read(path).at(path)?).at(path)?;
    if labels.len() != points.len() {
        let rule = format!("{} labels, but {} has {} points", labels.len(), sweep.display(), points.len());
        return Err(ImportError::at(path, rule));
    }
    let mut found = Vec::new();
    for (index, label) in labels.iter().enumerate().filter(|(index, _)| is_return(&points[*index])) {
        let class = class_of_label(label.class).ok_or_else(|| {
            ImportError::at(path, format!("label {index} has id {}, which SemanticKITTI does not define", label.class))
        })?;
        found.push(Label { class: class as u16, instance: label.instance });
    }
    Ok(bytes_from_labels(&found))
}
