//! Sweeps into the slots from which they are read.

use crate::frames::room;
use formats::drive::{DriveSweep, SweepSource};
use formats::velodyne::{LidarReturn, SweepReader};
use messages::{Sweep, SweepPoint};
use stage::{Loan, Outputs, StepError};

/// The next sweep in its slot; `None` at the end of the drive.
pub(crate) fn next(
    source: &mut SweepSource,
    outputs: &mut Outputs,
) -> Result<Option<(Loan<Sweep>, DriveSweep)>, StepError> {
    let mut loan = outputs.loan::<Sweep>(SweepReader::MAX_RETURNS)?;
    let mut full = None;
    let found = source
        .next_sweep(|returns| match room(&mut loan, returns.len()) {
            Ok(rows) => rows.iter_mut().zip(returns).for_each(|(row, found)| *row = point(found)),
            Err(error) => full = Some(error),
        })
        .map_err(StepError::data)?;
    match full {
        Some(error) => Err(error),
        None => Ok(found.map(|sweep| (loan, sweep))),
    }
}

fn point(found: &LidarReturn) -> SweepPoint {
    let LidarReturn { x, y, z, offset_nanos, azimuth, intensity, ring } = *found;
    SweepPoint { x, y, z, offset_nanos, azimuth, intensity, ring }
}
