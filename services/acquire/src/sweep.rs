//! Decodes sweeps directly into shared memory.

use crate::frames::room;
use formats::drive::{SweepInfo, SweepSource};
use formats::velodyne::{LidarReturn, SweepError, SweepPoll, SweepReader};
use messages::{SweepPoint, SweepTopic};
use stage::{Loan, Outputs, StepError};

/// A loan that any sweep fits into.
pub(crate) fn loan(outputs: &mut Outputs) -> Result<Loan<SweepTopic>, StepError> {
    outputs.loan::<SweepTopic>(SweepReader::MAX_RETURNS)
}

/// The next sweep in a loan; `None` at the end of the drive.
pub(crate) fn next(
    source: &mut SweepSource,
    outputs: &mut Outputs,
) -> Result<Option<(Loan<SweepTopic>, SweepInfo)>, StepError> {
    let mut loan = loan(outputs)?;
    let found = fill(&mut loan, |sink| source.next_sweep(sink))?;
    Ok(found.map(|sweep| (loan, sweep)))
}

/// Appends the new points of the incomplete sweep to its loan.
pub(crate) fn poll(reader: &mut SweepReader, loan: &mut Loan<SweepTopic>) -> Result<SweepPoll, StepError> {
    fill(loan, |sink| reader.poll_sweep(sink))
}

/// Appends the points that `read` passes on.
fn fill<T>(
    loan: &mut Loan<SweepTopic>,
    read: impl FnOnce(&mut dyn FnMut(&[LidarReturn])) -> Result<T, SweepError>,
) -> Result<T, StepError> {
    let mut full = None;
    let found = read(&mut |returns| match room(loan, returns.len()) {
        Ok(rows) => rows.iter_mut().zip(returns).for_each(|(row, found)| *row = point(found)),
        Err(error) => full = Some(error),
    })
    .map_err(StepError::data)?;
    full.map_or(Ok(found), Err)
}

fn point(found: &LidarReturn) -> SweepPoint {
    let LidarReturn { x, y, z, offset_nanos, azimuth, intensity, ring } = *found;
    SweepPoint { x, y, z, offset_nanos, azimuth, intensity, ring }
}
