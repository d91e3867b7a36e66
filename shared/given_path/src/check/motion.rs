//! Jumps of the path.

use crate::GivenPath;
use files::calendar::text_of_nanos;

/// Largest speed between two poses, m/s. A correction of the solution may be a step: below [`MAX_STEP_M`] it is accepted.
const MAX_SPEED_MPS: f64 = 100.0;
const MAX_STEP_M: f64 = 5.0;

pub(super) fn jump(path: &GivenPath) -> Result<(), String> {
    for pair in path.trajectory().poses().windows(2) {
        let [(begin, a), (end, b)] = pair else { continue };
        let step_m = (b.translation.vector - a.translation.vector).norm();
        let speed_mps = step_m / end.seconds_since(*begin).max(1e-6);
        if step_m > MAX_STEP_M && speed_mps > MAX_SPEED_MPS {
            let at = text_of_nanos(begin.0);
            return Err(format!(
                "the path jumps by {step_m:.1} m ({speed_mps:.0} m/s) at {at}; check the unit, the frame and the order of its columns"
            ));
        }
    }
    Ok(())
}
