//! Compares label files.

use super::point_confusion::{name_of, point_confusion};
use anyhow::Context;
use messages::ClassId;
use scores::Confusion;
use std::path::{Path, PathBuf};

/// The confusion matrix of each pair of files.
pub fn confusions(truth: &Path, prediction: &Path) -> anyhow::Result<Vec<(String, Confusion)>> {
    let pairs = if truth.is_dir() {
        let mut files: Vec<PathBuf> = std::fs::read_dir(truth)
            .with_context(|| truth.display().to_string())?
            .map(|entry| Ok(entry?.path()))
            .collect::<std::io::Result<_>>()?;
        files.retain(|path| path.extension().is_some_and(|extension| extension == "label"));
        files.sort();
        let beside = |path: &PathBuf| prediction.join(path.file_name().unwrap_or_default());
        files.iter().map(|path| (path.clone(), beside(path))).collect()
    } else {
        vec![(truth.to_owned(), prediction.to_owned())]
    };
    anyhow::ensure!(!pairs.is_empty(), "{}: no .label files", truth.display());
    let of_pair = |(truth, prediction): &(PathBuf, PathBuf)| {
        let (true_classes, predicted) = (classes(truth)?, classes(prediction)?);
        anyhow::ensure!(
            true_classes.len() == predicted.len(),
            "{} has {} points, {} has {}",
            truth.display(),
            true_classes.len(),
            prediction.display(),
            predicted.len()
        );
        let is_scored = |class: u8| class != ClassId::Unlabeled as u8;
        Ok((name_of(truth), point_confusion(&true_classes, &predicted, is_scored)))
    };
    pairs.iter().map(of_pair).collect()
}

/// Class ids of a file.
fn classes(path: &Path) -> anyhow::Result<Vec<u8>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let (words, rest) = bytes.as_chunks::<4>();
    anyhow::ensure!(
        rest.is_empty(),
        "{}: {} bytes; must be a multiple of 4, the size of a label",
        path.display(),
        bytes.len()
    );
    let class = |(i, word): (usize, &[u8; 4])| {
        let class = u32::from_le_bytes(*word) & 0xffff;
        let known = u8::try_from(class).ok().and_then(ClassId::from_id);
        let known =
            known.with_context(|| format!("{}: label {i} has class {class}; must be 0 to 22", path.display()))?;
        Ok(known as u8)
    };
    words.iter().enumerate().map(class).collect()
}
