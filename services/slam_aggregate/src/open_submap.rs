//! The submap that is being filled, in the memory from which consumers will read it.

use geometry::{Pose, Vector3};
use messages::SubmapTopic;
use registration::{OpenSubmap, Registered, SweepRows};
use stage::{Loan, Outputs, StepError};

/// An open submap. Its rows are in the loan.
pub(crate) struct LoanedSubmap {
    pub loan: Loan<SubmapTopic>,
    pub submap: OpenSubmap,
}

impl LoanedSubmap {
    /// An empty submap at the position and heading of the body.
    pub fn new(loan: Loan<SubmapTopic>, odom_from_body: &Pose, n_lidars: usize) -> Self {
        Self { loan, submap: OpenSubmap::new(odom_from_body, n_lidars as u32) }
    }
    /// Whether `n_sweeps` with `n_points` fit.
    pub fn fits(&self, n_sweeps: usize, n_points: usize) -> bool {
        self.submap.has_room(n_sweeps) && n_points <= self.loan.capacity() - self.loan.rows().len()
    }
    /// Appends the kept points of a sweep in order. `body` is the position of the body at the last shot in odom, m. The caller
    /// has checked [`LoanedSubmap::fits`].
    pub fn append(
        &mut self,
        points: SweepRows<'_>,
        registered: &Registered,
        body: Vector3<f64>,
    ) -> Result<(), StepError> {
        let first_point = self.loan.rows().len() as u32;
        let capacity = self.loan.capacity();
        let n_kept = points.kept.indices.len();
        let seq = points.raw.seq;
        let rows = self.loan.grow(n_kept).map_err(|_full| {
            StepError::data(format!(
                "sweep {seq}: {n_kept} points exceed a submap of {capacity}; increase submap_points_max"
            ))
        })?;
        self.submap.append(rows, first_point, points, registered, body);
        Ok(())
    }
    /// Publishes the submap.
    pub fn publish(mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let header = self.submap.finished(self.loan.rows().len());
        *self.loan.header_mut() = header;
        outputs.publish(self.loan, header.stamp_begin)
    }
}
