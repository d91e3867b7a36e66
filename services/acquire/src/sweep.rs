//! Sweeps into the slots from which they are read.

use crate::frames::room;
use formats::drive::{DriveSweep, SweepSource};
use formats::velodyne::{LidarReturn, SweepError, SweepPoll, SweepReader};
use messages::{Sweep, SweepPoint};
use stage::{Loan, Outputs, StepError};

/// A slot for any sweep.
pub(crate) fn loan(outputs: &mut Outputs) -> Result<Loan<Sweep>, StepError> {
    outputs.loan::<Sweep>(SweepReader::MAX_RETURNS)
}

/// The next sweep in its slot; `None` at the end of the drive.
pub(crate) fn next(
    source: &mut SweepSource,
    outputs: &mut Outputs,
) -> Result<Option<(Loan<Sweep>, DriveSweep)>, StepError> {
    let mut loan = loan(outputs)?;
    let found = fill(&mut loan, |sink| source.next_sweep(sink))?;
    Ok(found.map(|sweep| (loan, sweep)))
}

/// What has come of the sweep under way, into its slot.
pub(crate) fn poll(reader: &mut SweepReader, loan: &mut Loan<Sweep>) -> Result<SweepPoll, StepError> {
    fill(loan, |sink| reader.poll_sweep(sink))
}

/// Appends what `read` hands over.
fn fill<T>(
    loan: &mut Loan<Sweep>,
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
