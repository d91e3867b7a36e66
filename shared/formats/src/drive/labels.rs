//! Ground-truth class and instance of every return of a simulated or annotated drive.

use super::labelled_sweep::{LabelledSweep, NoLabel, Shot};
use super::{Drive, SweepSource};
use crate::lidar::SweepPoint;
use crate::problems::FileProblem;
use std::path::{Path, PathBuf};

/// Class and instance of a return.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueLabel {
    /// Class id of the class table.
    pub class: u8,
    /// Instance, 0 = none.
    pub instance: u16,
}

/// Reads the labels of a drive sweep by sweep.
#[derive(Debug)]
pub struct LabelReader {
    drive: PathBuf,
    folder: PathBuf,
    source: SweepSource,
    points: Vec<SweepPoint>,
}

/// Labels of a whole drive. Memory: 12 bytes per return.
#[derive(Clone, Debug)]
pub struct TrueLabels {
    sweeps: Vec<LabelledSweep>,
}

impl Drive {
    /// A reader of the labels, at the first sweep. An error if the drive has no labels.
    pub fn label_reader(&self) -> Result<LabelReader, FileProblem> {
        let labels = self.manifest.truth.as_ref().and_then(|truth| truth.labels.as_ref());
        let Some(labels) = labels else {
            let rule = "the manifest has no [truth] labels, the folder of the labels";
            return Err(FileProblem::of_file(&self.folder, rule));
        };
        let source = self.sweeps().map_err(|error| FileProblem::of_file(&self.folder, error.to_string()))?;
        let folder = self.folder.join(labels);
        Ok(LabelReader { drive: self.folder.clone(), folder, source, points: Vec::new() })
    }

    /// The labels of all returns. An error if the drive has no labels, or the labels of a sweep are not as many as its returns.
    pub fn true_labels(&self) -> Result<TrueLabels, FileProblem> {
        let mut reader = self.label_reader()?;
        let mut sweeps = Vec::new();
        while let Some(sweep) = reader.next_sweep()? {
            sweeps.push(sweep);
        }
        Ok(TrueLabels { sweeps })
    }
}

impl LabelReader {
    /// The labels of the next sweep; `None` at the end of the drive. An error if they are not as many as its returns.
    pub fn next_sweep(&mut self) -> Result<Option<LabelledSweep>, FileProblem> {
        let fault = |file: &Path, rule: String| FileProblem::of_file(file, rule);
        self.points.clear();
        let next = self.source.next_sweep(|found| self.points.extend_from_slice(found));
        let Some(sweep) = next.map_err(|error| fault(&self.drive, error.to_string()))? else { return Ok(None) };
        let path = self.folder.join(format!("{:06}.label", sweep.seq));
        let bytes = std::fs::read(&path).map_err(|error| fault(&path, format!("cannot read the file: {error}")))?;
        let (labels, rest) = bytes.as_chunks::<4>();
        if labels.len() != self.points.len() || !rest.is_empty() {
            let rule = format!("{} bytes for {} returns; expected 4 bytes per return", bytes.len(), self.points.len());
            return Err(fault(&path, rule));
        }
        Ok(Some(LabelledSweep::new(&sweep, &self.points, labels.iter().copied().map(label))))
    }
}

fn label(bytes: [u8; 4]) -> TrueLabel {
    let word = u32::from_le_bytes(bytes);
    // Classes of 256 and more are unknown.
    TrueLabel { class: u8::try_from(word & 0xffff).unwrap_or(0), instance: (word >> 16) as u16 }
}

impl TrueLabels {
    /// The label of a return.
    pub fn find(&self, shot: &Shot) -> Result<TrueLabel, NoLabel> {
        find_label(&self.sweeps, shot)
    }
}

/// The label of a return in consecutive sweeps, which are sorted by time.
pub fn find_label(sweeps: &[LabelledSweep], shot: &Shot) -> Result<TrueLabel, NoLabel> {
    let after = sweeps.partition_point(|sweep| sweep.begins_before(shot.stamp));
    let [before @ .., last] = &sweeps[..after] else { return Err(NoLabel::NoSweep) };
    // Times that the odometry gave to points without times may reach into the next sweep.
    last.find(shot).or_else(|fault| before.last().and_then(|sweep| sweep.find(shot).ok()).ok_or(fault))
}
