//! Ground-truth class and instance of every return of a simulated or annotated drive.

use super::labelled_sweep::{LabelledSweep, NoLabel, Shot, TrueLabel};
use super::{Drive, SweepSource};
use files::problems::FileProblem;
use files::regular_file;
use lidar::SweepPoint;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Reads the labels of a drive sweep by sweep.
#[derive(Debug)]
pub struct LabelReader {
    drive: PathBuf,
    folder: PathBuf,
    source: SweepSource,
    points: Vec<SweepPoint>,
    /// Label files read so far.
    n_files: u64,
}

/// Labels of a whole drive. Memory: 12 bytes per return.
#[derive(Clone, Debug)]
pub struct TrueLabels {
    sweeps: Vec<LabelledSweep>,
}

impl Drive {
    /// A reader of the labels, at the first sweep. Fails if the drive has no labels.
    pub fn label_reader(&self) -> Result<LabelReader, FileProblem> {
        let labels = self.manifest.truth.as_ref().and_then(|truth| truth.labels.as_ref());
        let Some(labels) = labels else {
            let rule = "the manifest has no [truth] labels, the folder of the labels";
            return Err(FileProblem::for_file(&self.folder, rule));
        };
        let source = self.sweeps().map_err(|error| FileProblem::for_file(&self.folder, error.to_string()))?;
        let folder = self.folder.join(labels);
        Ok(LabelReader { drive: self.folder.clone(), folder, source, points: Vec::new(), n_files: 0 })
    }

    /// The labels of all returns of the sweeps that have a label file. Other sweeps are left out, because some data sets
    /// label only key frames. Fails if the drive has no labels, or if the number of labels of a sweep differs from the
    /// number of its returns.
    pub fn true_labels(&self) -> Result<TrueLabels, FileProblem> {
        let mut reader = self.label_reader()?;
        let mut sweeps = Vec::new();
        while let Some(sweep) = reader.next_sweep()? {
            if sweep.has_labels() {
                sweeps.push(sweep);
            }
        }
        Ok(TrueLabels { sweeps })
    }
}

impl LabelReader {
    /// The next sweep, with its labels if it has a label file; `None` at the end of the drive. Fails if the number of
    /// labels differs from the number of returns, or if no sweep has a file.
    pub fn next_sweep(&mut self) -> Result<Option<LabelledSweep>, FileProblem> {
        let fault = |file: &Path, rule: String| FileProblem::for_file(file, rule);
        self.points.clear();
        let next = self.source.next_sweep(|found| self.points.extend_from_slice(found));
        if let Some(sweep) = next.map_err(|error| fault(&self.drive, error.to_string()))? {
            let path = self.folder.join(format!("{:06}.label", sweep.seq));
            let bytes = match regular_file::read(&path) {
                Err(error) if error.kind() == ErrorKind::NotFound => {
                    return Ok(Some(LabelledSweep::unlabeled(&sweep, &self.points)));
                }
                read => read.map_err(|error| fault(&path, format!("cannot read the file: {error}")))?,
            };
            self.n_files += 1;
            let (labels, rest) = bytes.as_chunks::<4>();
            if labels.len() != self.points.len() || !rest.is_empty() {
                let n_bytes = bytes.len();
                let n_returns = self.points.len();
                let rule = format!("{n_bytes} bytes for {n_returns} returns; expected 4 bytes per return");
                return Err(fault(&path, rule));
            }
            return Ok(Some(LabelledSweep::new(&sweep, &self.points, labels.iter().copied().map(label))));
        }
        if self.n_files == 0 {
            return Err(fault(
                &self.folder,
                "contains no label file of a sweep, 000000.label for the first".to_owned(),
            ));
        }
        Ok(None)
    }
}

fn label(bytes: [u8; 4]) -> TrueLabel {
    let word = u32::from_le_bytes(bytes);
    // Classes of 256 and more are unlabeled.
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
    // Times that the odometry assigned to points without times may reach into the next sweep.
    last.find(shot).or_else(|fault| before.last().and_then(|sweep| sweep.find(shot).ok()).ok_or(fault))
}
