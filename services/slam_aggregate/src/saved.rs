//! The saved state of the stage.

use crate::open_submap::LoanedSubmap;
use georeference::{Georeferencer, GivenPlacing, InertialUnit};
use messages::{SubmapHeader, SubmapPoint, SubmapTopic, pod};
use registration::{BodyPoses, OpenSubmap, SecondaryLidar, SelectedState, Stretches, SubmapFrame};
use serde::{Deserialize, Serialize};
use stage::{Bytes, Outputs, StepError};
use std::borrow::Cow;

/// Incremented when the layout of [`Saved`] or the meaning of a field changes.
pub(crate) const STATE_VERSION: u32 = 17;

/// The state on which the next tick depends: the state of the odometry (at most 4.3 MB with default settings and 32
/// rings; 72 MB more with `odometry = "imls"`) and up to 80 kB for each place that is kept for loop closures. Two parts
/// follow it without a copy: the sweeps of the first tick while they wait for the second (about 1.3 MB), and the rows
/// of the open submap (28 bytes a point).
#[derive(Serialize, Deserialize)]
pub(crate) struct Saved<'a> {
    pub odometry: SelectedState,
    /// Number of sweeps of the first tick, while it waits for the second.
    pub n_waiting: u32,
    pub submap: Option<SubmapHead>,
    pub poses: BodyPoses,
    pub secondary_lidars: Cow<'a, [SecondaryLidar]>,
    // Borrowed while saving: they grow with the drive.
    pub stretches: Cow<'a, Stretches>,
    pub inertial: Cow<'a, InertialUnit>,
    pub georeferencer: Cow<'a, Georeferencer>,
    pub given: Cow<'a, GivenPlacing>,
    /// [`given_path::GivenPath::fingerprint`]; 0 without a path. The poses are read again from their file.
    pub path: u64,
}

/// A [`LoanedSubmap`] without its rows.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct SubmapHead {
    frame: SubmapFrame,
    header: Bytes,
    n_rows: u64,
}

/// A [`LoanedSubmap`] outside shared memory.
pub(crate) struct SavedSubmap {
    pub head: SubmapHead,
    pub rows: Vec<u8>,
}

impl SubmapHead {
    pub fn from_submap(open: &LoanedSubmap) -> Self {
        let OpenSubmap { frame, header } = &open.submap;
        let header = Bytes(pod::bytes_from_rows(std::slice::from_ref(&**header)).to_vec());
        Self { frame: *frame, header, n_rows: open.loan.rows().len() as u64 }
    }
}

impl SavedSubmap {
    /// Copies the rows into a new loan.
    pub fn reopen(&self, outputs: &mut Outputs, capacity: usize) -> Result<LoanedSubmap, StepError> {
        let torn = || StepError::data("saved state: header or rows of the open submap have the wrong length");
        let header = pod::rows_from_bytes::<SubmapHeader>(&self.head.header.0).ok_or_else(torn)?;
        let [header] = header[..] else { return Err(torn()) };
        let rows = pod::rows_from_bytes::<SubmapPoint>(&self.rows).ok_or_else(torn)?;
        // Points saved under a larger limit must not be lost.
        let mut loan = outputs.loan::<SubmapTopic>(capacity.max(rows.len()))?;
        loan.extend_from_slice(&rows)?;
        Ok(LoanedSubmap { loan, submap: OpenSubmap { frame: self.head.frame, header: Box::new(header) } })
    }
    /// Loads the submap. `rows` is the rest of a state.
    pub fn load(head: Option<SubmapHead>, rows: &[u8]) -> Result<Option<Self>, StepError> {
        let n_rows = head.as_ref().map_or(0, |head| head.n_rows);
        if rows.len() as u64 != n_rows * size_of::<SubmapPoint>() as u64 {
            let n_bytes = rows.len();
            return Err(StepError::data(format!(
                "saved state: {n_bytes} bytes for the {n_rows} points of the open submap"
            )));
        }
        Ok(head.map(|head| Self { head, rows: rows.to_vec() }))
    }
}
