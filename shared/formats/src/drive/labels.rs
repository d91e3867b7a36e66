//! Ground-truth class and instance of every return of a simulated or annotated drive.

use super::Drive;
use crate::problems::FileProblem;
use std::io::ErrorKind;
use std::path::Path;

/// Tolerance of times: a time stored as f64 seconds is rounded to 0.24 µs, and a laser fires every 46 µs.
const TOLERANCE_NANOS: i64 = 500;

/// Class and instance of a return.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueLabel {
    /// Class id of the class table.
    pub class: u8,
    /// Instance, 0 = none.
    pub instance: u16,
}

/// Labels of a whole drive. Memory: 8 bytes per return.
#[derive(Clone, Debug)]
pub struct TrueLabels {
    sweeps: Vec<LabelledSweep>,
}

#[derive(Clone, Debug)]
struct LabelledSweep {
    stamp: i64,
    /// Sorted by ring, then time.
    returns: Vec<Labelled>,
}

#[derive(Clone, Copy, Debug)]
struct Labelled {
    offset_nanos: u32,
    ring: u8,
    label: TrueLabel,
}

impl Drive {
    /// The labels of all returns of the sweeps that have a label file. An error if there is none, or the labels of a sweep are not as
    /// many as its returns.
    pub fn true_labels(&self) -> Result<TrueLabels, FileProblem> {
        let fault = |file: &Path, rule: String| FileProblem::of_file(file, rule);
        let labels = self.manifest.truth.as_ref().and_then(|truth| truth.labels.as_ref());
        let Some(labels) = labels else {
            return Err(fault(&self.folder, "the manifest has no [truth] labels, the folder of the labels".to_owned()));
        };
        let folder = self.folder.join(labels);
        let mut source = self.sweeps().map_err(|error| fault(&self.folder, error.to_string()))?;
        let mut sweeps = Vec::new();
        let mut n_files = 0;
        loop {
            let mut returns = Vec::new();
            let next = source.next_sweep(|found| returns.extend(found.iter().map(|r| (r.offset_nanos, r.ring))));
            let Some(sweep) = next.map_err(|error| fault(&self.folder, error.to_string()))? else { break };
            let path = folder.join(format!("{:06}.label", sweep.seq));
            let bytes = match std::fs::read(&path) {
                // Data sets that label key frames only.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                read => read.map_err(|error| fault(&path, format!("cannot read the file: {error}")))?,
            };
            n_files += 1;
            let (labels, rest) = bytes.as_chunks::<4>();
            if labels.len() != returns.len() || !rest.is_empty() {
                let rule = format!("{} bytes for {} returns; expected 4 bytes per return", bytes.len(), returns.len());
                return Err(fault(&path, rule));
            }
            let label = |&bytes: &[u8; 4]| {
                let word = u32::from_le_bytes(bytes);
                // Classes of 256 and more are unknown.
                TrueLabel { class: u8::try_from(word & 0xffff).unwrap_or(0), instance: (word >> 16) as u16 }
            };
            let both = returns.iter().zip(labels);
            let mut returns: Vec<Labelled> = both
                .map(|(&(offset_nanos, ring), bytes)| Labelled { offset_nanos, ring, label: label(bytes) })
                .collect();
            returns.sort_by_key(|r| (r.ring, r.offset_nanos));
            sweeps.push(LabelledSweep { stamp: sweep.stamp.0, returns });
        }
        if n_files == 0 {
            return Err(fault(&folder, "contains no label file of a sweep, 000000.label for the first".to_owned()));
        }
        Ok(TrueLabels { sweeps })
    }
}

impl TrueLabels {
    /// Label of the return of a ring at a time (ns since the Unix epoch). `None` if there is no return within 0.5 µs.
    pub fn find(&self, stamp: i64, ring: u8) -> Option<TrueLabel> {
        let after = self.sweeps.partition_point(|sweep| sweep.stamp <= stamp + TOLERANCE_NANOS);
        let sweep = &self.sweeps[after.checked_sub(1)?];
        let offset = stamp - sweep.stamp;
        let first = offset - TOLERANCE_NANOS;
        let at = sweep.returns.partition_point(|r| (r.ring, i64::from(r.offset_nanos)) < (ring, first));
        let found = sweep.returns.get(at).filter(|r| r.ring == ring);
        found.filter(|r| i64::from(r.offset_nanos) <= offset + TOLERANCE_NANOS).map(|r| r.label)
    }
}
