//! Reads labelled sweeps.

use super::sweep_files::{self, SweepFiles};
use anyhow::Context;
use candle_core::{Tensor, WithDType};
use files::regular_file;
use formats::kitti::{labels_from_bytes, points_from_bin};
use formats::semantic_kitti::{CLASS_OF_BENCHMARK_ID, benchmark_id_of_label};
use std::path::Path;

/// A sweep with the benchmark's ids, 0 to 19.
pub struct LabelledSweep {
    /// Positions in the sensor frame, m.
    pub points: Vec<[f32; 3]>,
    /// Intensity of each point; zeros without intensities.
    pub intensities: Vec<u8>,
    /// Id of each point.
    pub ids: Vec<u32>,
}

/// All sweeps of a folder.
pub fn labelled_sweeps(folder: &Path) -> anyhow::Result<Vec<LabelledSweep>> {
    let sequences = sweep_files::sequences(folder)?;
    sequences.iter().flat_map(|sequence| &sequence.sweeps).map(LabelledSweep::read).collect()
}

impl LabelledSweep {
    /// Reads points and labels.
    pub fn read(files: &SweepFiles) -> anyhow::Result<Self> {
        let is_array = files.points.extension().is_some_and(|extension| extension == "npy");
        let sweep = if is_array { read_arrays(files)? } else { read_kitti(files)? };
        let n_points = sweep.points.len();
        let n_labels = sweep.ids.len();
        anyhow::ensure!(
            n_points == n_labels,
            "{}: {n_labels} labels, but {} has {n_points} points",
            files.labels.display(),
            files.points.display()
        );
        Ok(sweep)
    }
}

fn read_kitti(files: &SweepFiles) -> anyhow::Result<LabelledSweep> {
    let about = || files.points.display().to_string();
    let cloud = points_from_bin(&regular_file::read(&files.points).with_context(about)?).with_context(about)?;
    let about = || files.labels.display().to_string();
    let labels = labels_from_bytes(&regular_file::read(&files.labels).with_context(about)?).with_context(about)?;
    let id = |(index, label): (usize, &formats::kitti::Label)| {
        let id = benchmark_id_of_label(label.class).map(u32::from);
        let class = label.class;
        id.with_context(|| format!("{}: label {index} has id {class}, which SemanticKITTI does not define", about()))
    };
    Ok(LabelledSweep {
        points: cloud.iter().map(|point| [point.x, point.y, point.z]).collect(),
        // Reflectances of 0 to 1, on the scale on which drives are imported.
        intensities: cloud.iter().map(|point| (point.intensity * 255.0).round().clamp(0.0, 255.0) as u8).collect(),
        ids: labels.iter().enumerate().map(id).collect::<anyhow::Result<_>>()?,
    })
}

fn read_arrays(files: &SweepFiles) -> anyhow::Result<LabelledSweep> {
    let coordinates: Vec<f32> = read_npy(&files.points)?;
    let points = coordinates.as_chunks::<3>().0.to_vec();
    let ids: Vec<i32> = read_npy(&files.labels)?;
    let last = CLASS_OF_BENCHMARK_ID.len() - 1;
    let checked = |id: i32| u32::try_from(id).ok().filter(|&id| id as usize <= last);
    let ids: Option<Vec<u32>> = ids.into_iter().map(checked).collect();
    let ids = ids.with_context(|| format!("{}: ids must be 0 to {last}", files.labels.display()))?;
    Ok(LabelledSweep { intensities: vec![0; points.len()], points, ids })
}

/// The numbers of a `.npy` file in C order.
fn read_npy<T: WithDType>(path: &Path) -> anyhow::Result<Vec<T>> {
    let about = || path.display().to_string();
    let bytes = regular_file::read(path).with_context(about)?;
    formats::npy::check_header(&bytes).with_context(about)?;
    let array = Tensor::read_npy(path).with_context(about)?;
    array.flatten_all()?.to_vec1().with_context(about)
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::cloud::CloudPoint;
    use formats::kitti::{Label, bin_from_points, bytes_from_labels};

    fn written(folder: &Path, labels: &[Label]) -> SweepFiles {
        let files = SweepFiles { points: folder.join("000000.bin"), labels: folder.join("000000.label") };
        let points = [0.0, 0.5, 1.0].map(|intensity| CloudPoint { x: 1.0, y: 2.0, z: 3.0, intensity });
        std::fs::write(&files.points, bin_from_points(&points)).expect("writes");
        std::fs::write(&files.labels, bytes_from_labels(labels)).expect("writes");
        files
    }

    #[test]
    fn kitti_sweep_has_intensities_and_benchmark_ids() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let labels = [(60, 0), (252, 7), (99, 0)].map(|(class, instance)| Label { class, instance });
        let sweep = LabelledSweep::read(&written(folder.path(), &labels)).expect("is read");
        assert_eq!((sweep.ids, sweep.intensities), (vec![9, 1, 0], vec![0, 128, 255]));
        assert_eq!(sweep.points, [[1.0, 2.0, 3.0]; 3]);
    }

    #[test]
    fn missing_labels_and_unknown_ids_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = |labels: &[Label]| {
            LabelledSweep::read(&written(folder.path(), labels)).err().expect("is refused").to_string()
        };
        let label = |class| Label { class, instance: 0 };
        let short = error(&[label(40), label(40)]);
        assert!(short.contains("000000.label: 2 labels, but") && short.ends_with("has 3 points"), "{short}");
        let unknown = error(&[label(40), label(2), label(40)]);
        assert!(unknown.contains("label 1 has id 2, which SemanticKITTI does not define"), "{unknown}");
    }
}
