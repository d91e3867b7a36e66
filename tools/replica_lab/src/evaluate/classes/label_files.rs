//! Compares label files.

use super::folder::sorted_entries;
use super::source::{Origin, Source};
use super::tally::{Tally, TrueClass};
use anyhow::Context;
use files::regular_file;
use messages::ClassId;
use std::path::{Path, PathBuf};

/// Scores each pair of files.
pub fn sources(truth: &Path, prediction: &Path, empty: &Tally) -> anyhow::Result<Vec<Source>> {
    let pairs = if truth.is_dir() {
        let mut files = sorted_entries(truth)?;
        files.retain(|path| path.extension().is_some_and(|extension| extension == "label"));
        let predicted = |path: &PathBuf| prediction.join(path.file_name().unwrap_or_default());
        files.iter().map(|path| (path.clone(), predicted(path))).collect()
    } else {
        vec![(truth.to_owned(), prediction.to_owned())]
    };
    anyhow::ensure!(!pairs.is_empty(), "{}: no .label files", truth.display());
    let of_pair = |(truth, prediction): &(PathBuf, PathBuf)| {
        let true_classes = classes(truth)?;
        let predicted = classes(prediction)?;
        anyhow::ensure!(
            true_classes.len() == predicted.len(),
            "{} has {} points, {} has {}",
            truth.display(),
            true_classes.len(),
            prediction.display(),
            predicted.len()
        );
        let mut tally = empty.clone();
        for (class, found) in true_classes.into_iter().zip(predicted) {
            if class != ClassId::Unlabeled as u8 {
                tally.add_class(TrueClass::from_id(class), found);
            }
        }
        let name = truth.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Source { name, origin: Origin::Files, n_sweeps: 0, has_intensities: false, tally, other_uses: Vec::new() })
    };
    pairs.iter().map(of_pair).collect()
}

/// Class ids of a file.
fn classes(path: &Path) -> anyhow::Result<Vec<u8>> {
    let bytes = regular_file::read(path).with_context(|| path.display().to_string())?;
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
