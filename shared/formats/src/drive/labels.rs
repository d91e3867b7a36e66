//! True class and instance of every return of a simulated or annotated drive.

use super::Drive;
use crate::problems::FileProblem;
use std::path::Path;

/// A point's time may have been rounded to a double of seconds, which keeps 0.24 us; a laser fires every 46 us.
const TOLERANCE_NANOS: i64 = 500;

/// What a return lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueLabel {
    /// Id in the class table.
    pub class: u8,
    /// 0 = none.
    pub instance: u16,
}

/// The labels of a whole drive, 8 bytes a return.
#[derive(Clone, Debug)]
pub struct TrueLabels {
    sweeps: Vec<LabelledSweep>,
}

#[derive(Clone, Debug)]
struct LabelledSweep {
    stamp: i64,
    /// By ring, then time.
    returns: Vec<Labelled>,
}

#[derive(Clone, Copy, Debug)]
struct Labelled {
    offset_nanos: u32,
    ring: u8,
    label: TrueLabel,
}

impl Drive {
    /// The labels of all returns. An error if the drive has none, or a sweep has not as many as returns.
    pub fn true_labels(&self) -> Result<TrueLabels, FileProblem> {
        let fault = |file: &Path, rule: String| FileProblem::of_file(file, rule);
        let Some(truth) = &self.manifest.truth else {
            return Err(fault(
                &self.folder,
                "the drive has no [truth]: classes of its returns are not known".to_owned(),
            ));
        };
        let folder = self.folder.join(&truth.labels);
        let mut source = self.sweeps().map_err(|error| fault(&self.folder, error.to_string()))?;
        let mut sweeps = Vec::new();
        loop {
            let mut returns = Vec::new();
            let next = source.next_sweep(|found| returns.extend(found.iter().map(|r| (r.offset_nanos, r.ring))));
            let Some(sweep) = next.map_err(|error| fault(&self.folder, error.to_string()))? else { break };
            let path = folder.join(format!("{:06}.label", sweep.seq));
            let bytes = std::fs::read(&path).map_err(|error| fault(&path, format!("cannot be read: {error}")))?;
            let (labels, rest) = bytes.as_chunks::<4>();
            if labels.len() != returns.len() || !rest.is_empty() {
                let rule = format!("{} bytes for {} returns, must be 4 each", bytes.len(), returns.len());
                return Err(fault(&path, rule));
            }
            let label = |&bytes: &[u8; 4]| {
                let word = u32::from_le_bytes(bytes);
                // Classes are fewer than 256; what is above says nothing that we know.
                TrueLabel { class: u8::try_from(word & 0xffff).unwrap_or(0), instance: (word >> 16) as u16 }
            };
            let both = returns.iter().zip(labels);
            let mut returns: Vec<Labelled> = both
                .map(|(&(offset_nanos, ring), bytes)| Labelled { offset_nanos, ring, label: label(bytes) })
                .collect();
            returns.sort_by_key(|r| (r.ring, r.offset_nanos));
            sweeps.push(LabelledSweep { stamp: sweep.stamp.0, returns });
        }
        Ok(TrueLabels { sweeps })
    }
}

impl TrueLabels {
    /// What the return of that time (ns since the Unix epoch) and ring lies on; `None` if there was none within half a
    /// microsecond.
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
