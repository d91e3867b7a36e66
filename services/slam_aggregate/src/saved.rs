//! The stage's state, to the bit.

use crate::drive_graph::DriveGraph;
use crate::open_submap::{OpenSubmap, SubmapFrame};
use crate::weak_stretches::WeakStretches;
use messages::{Submap, SubmapHeader, SubmapPoint, pod};
use registration::OdometryState;
use serde::{Deserialize, Serialize};
use stage::{Bytes, Outputs, StepError};

/// Raised when the layout of [`Saved`] or the meaning of a field changes.
pub(crate) const STATE_VERSION: u32 = 5;

/// Everything that the next tick depends on: the odometry's state (at most 4.3 MB with default settings and 32 rings), the first
/// sweep while it waits for the second (about 1.3 MB), the open submap (28 bytes a point), and 70 kB for each submap that is
/// complete.
#[derive(Serialize, Deserialize)]
pub(crate) struct Saved {
    pub odometry: OdometryState,
    /// See `Received::to_bytes`.
    pub waiting: Option<Bytes>,
    pub submap: Option<SavedSubmap>,
    pub last_row_stamp: Option<i64>,
    pub weak: WeakStretches,
    pub graph: DriveGraph,
}

/// An [`OpenSubmap`] outside shared memory.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedSubmap {
    frame: SubmapFrame,
    header: Bytes,
    rows: Bytes,
}

impl SavedSubmap {
    pub fn of(open: &OpenSubmap) -> Self {
        Self {
            frame: open.frame,
            header: Bytes(pod::bytes_from_rows(std::slice::from_ref(&*open.header)).to_vec()),
            rows: Bytes(pod::bytes_from_rows(open.loan.rows()).to_vec()),
        }
    }
    /// Into a fresh slot: the only time that rows are copied.
    pub fn reopen(&self, outputs: &mut Outputs, capacity: usize) -> Result<OpenSubmap, StepError> {
        let torn = || StepError::data("the saved submap's header or rows have the wrong length");
        let header = pod::rows_from_bytes::<SubmapHeader>(&self.header.0).ok_or_else(torn)?;
        let [header] = header[..] else { return Err(torn()) };
        let rows = pod::rows_from_bytes::<SubmapPoint>(&self.rows.0).ok_or_else(torn)?;
        // A smaller limit than before must not lose what is there.
        let mut loan = outputs.loan::<Submap>(capacity.max(rows.len()))?;
        loan.extend_from_slice(&rows).ok_or_else(torn)?;
        Ok(OpenSubmap { loan, frame: self.frame, header: Box::new(header) })
    }
}
