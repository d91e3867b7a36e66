//! Decodes sweeps directly into shared memory.

use lidar::SweepReader;
use messages::{SweepPoint, SweepTopic};
use stage::{Loan, Outputs, StepError};

/// A loan with room for any sweep.
pub(crate) fn loan(outputs: &mut Outputs) -> Result<Loan<SweepTopic>, StepError> {
    outputs.loan::<SweepTopic>(SweepReader::MAX_RETURNS)
}

/// Appends the points that `read` passes on.
pub(crate) fn fill<T>(
    loan: &mut Loan<SweepTopic>,
    read: impl FnOnce(&mut dyn FnMut(&[SweepPoint])) -> Result<T, StepError>,
) -> Result<T, StepError> {
    let mut full = None;
    let found = read(&mut |returns| match loan.grow_unset(returns.len()) {
        Ok(rows) => rows.copy_from_slice(returns),
        Err(error) => full = Some(error.into()),
    })?;
    full.map_or(Ok(found), Err)
}
