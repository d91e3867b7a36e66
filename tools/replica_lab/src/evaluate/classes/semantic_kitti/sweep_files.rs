//! Finds labelled sweeps: in the layout of SemanticKITTI, or as NumPy arrays.

use crate::evaluate::classes::folder::sorted_entries;
use anyhow::Context;
use std::path::{Path, PathBuf};

/// Points and labels of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepFiles {
    /// Points: `.bin` of KITTI, or `.npy`.
    pub points: PathBuf,
    /// Labels: `.label` for a `.bin`, or `.npy`.
    pub labels: PathBuf,
}

/// Sweeps that are scored together.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Name of its folder, or of its file.
    pub name: String,
    /// Sweeps, in the order of their names.
    pub sweeps: Vec<SweepFiles>,
}

/// The labelled sweeps of a folder: a sequence with `velodyne/*.bin` and `labels/*.label`, several such sequences (also below
/// `sequences` or `dataset/sequences`), or pairs of `*_points_*.npy` and `*_labels_*.npy`, each of which is its own sequence.
/// Sequences and sweeps without labels are left out.
pub fn sequences(folder: &Path) -> anyhow::Result<Vec<Sequence>> {
    let entries = sorted_entries(folder)?;
    let arrays: Vec<Sequence> = entries.iter().filter_map(|path| array_pair(path)).collect();
    if !arrays.is_empty() {
        return Ok(arrays);
    }
    if folder.join("velodyne").is_dir() {
        return Ok(vec![sequence(folder)?]);
    }
    for place in ["", "sequences", "dataset/sequences"].map(|place| folder.join(place)) {
        let folders = if place.is_dir() { sorted_entries(&place)? } else { Vec::new() };
        let has_labels = |path: &&PathBuf| path.join("velodyne").is_dir() && path.join("labels").is_dir();
        let found: Vec<Sequence> =
            folders.iter().filter(has_labels).map(|path| sequence(path)).collect::<anyhow::Result<_>>()?;
        if !found.is_empty() {
            return Ok(found);
        }
    }
    anyhow::bail!(
        "{}: no labelled sweeps in this folder; there must be *_points_*.npy files, or velodyne/*.bin and labels/*.label of one \
         sequence or of several in separate folders",
        folder.display()
    )
}

/// A sequence in the layout of the data set.
fn sequence(folder: &Path) -> anyhow::Result<Sequence> {
    // A path such as `.` or `08/..` does not end with the name of the folder.
    let named = folder.canonicalize().with_context(|| folder.display().to_string())?;
    let labels = folder.join("labels");
    let is_label = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "label");
    let files: Vec<PathBuf> = sorted_entries(&labels)?.into_iter().filter(is_label).collect();
    anyhow::ensure!(!files.is_empty(), "{}: no *.label file in this folder", labels.display());
    let pair = |labels: PathBuf| {
        let points = folder.join("velodyne").join(format!("{}.bin", name_of(&labels)));
        anyhow::ensure!(points.is_file(), "{}: its sweep {} does not exist", labels.display(), points.display());
        Ok(SweepFiles { points, labels })
    };
    Ok(Sequence { name: name_of(&named), sweeps: files.into_iter().map(pair).collect::<anyhow::Result<_>>()? })
}

fn array_pair(path: &Path) -> Option<Sequence> {
    let name = name_of(path);
    if !(path.to_string_lossy().ends_with(".npy") && name.contains("_points_")) {
        return None;
    }
    let labels = path.with_file_name(name.replace("_points_", "_labels_")).with_extension("npy");
    Some(Sequence { name, sweeps: vec![SweepFiles { points: path.to_owned(), labels }] })
}

/// The file name without its extension.
pub fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(path: &Path) {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("creates");
        std::fs::write(path, []).expect("writes");
    }

    #[test]
    fn labelled_sequences_of_data_set_are_found_from_every_level() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let sequences_of = root.path().join("dataset/sequences");
        for name in
            ["08/velodyne/000001.bin", "08/velodyne/000000.bin", "08/velodyne/000002.bin", "11/velodyne/000000.bin"]
        {
            touch(&sequences_of.join(name));
        }
        for name in
            ["08/labels/000001.label", "08/labels/000000.label", "00/labels/000000.label", "00/velodyne/000000.bin"]
        {
            touch(&sequences_of.join(name));
        }
        for folder in [root.path().to_owned(), root.path().join("dataset"), sequences_of.clone()] {
            let found = sequences(&folder).expect("has sequences");
            let shape: Vec<(&str, usize)> = found.iter().map(|of| (of.name.as_str(), of.sweeps.len())).collect();
            assert_eq!(shape, [("00", 1), ("08", 2)], "{}", folder.display());
        }
        let one = sequences(&sequences_of.join("08")).expect("is a sequence");
        assert_eq!((one.len(), one[0].name.as_str()), (1, "08"));
        assert_eq!(name_of(&one[0].sweeps[1].points), "000001");
    }

    #[test]
    fn folder_without_sweeps_or_with_missing_sweep_is_refused() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let error = sequences(root.path()).expect_err("is empty").to_string();
        assert!(error.contains("velodyne/*.bin and labels/*.label"), "{error}");
        touch(&root.path().join("08/labels/000007.label"));
        touch(&root.path().join("08/velodyne/000008.bin"));
        let error = sequences(root.path()).expect_err("has no such sweep").to_string();
        assert!(error.contains("000007.label: its sweep") && error.contains("000007.bin does not exist"), "{error}");
    }
}
