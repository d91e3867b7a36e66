//! The end of the run: whether the fixes of the GNSS receiver place the result.

use georeference::{FixUse, Placed};
use messages::PlacementHeader;
use stage::Outputs;

/// Reports doubts. `is_expected`: the drive has a receiver. `placed`: `None` without submaps, which export reports.
pub(crate) fn report(placed: Option<&Placed>, is_expected: bool, min_used_share: f64, outputs: &mut Outputs) {
    let (n_valid, n_invalid) = (outputs.counted("fixes"), outputs.counted("fixes_without_position"));
    if n_valid == 0 {
        if (is_expected || n_invalid > 0) && min_used_share > 0.0 {
            let text = format!(
                "the drive has a GNSS receiver, but no usable fix ({n_invalid} arrived without a position): the result is not \
                 georeferenced; does the receiver send positions with heights (NMEA GGA)?"
            );
            outputs.doubt("no_usable_fix", 0.0, text);
        }
        return;
    }
    let Some(Placed { header, fixes, .. }) = placed else { return };
    if let Some(delay) = fixes.delay.filter(|delay| delay.is_out_of_range() && min_used_share > 0.0) {
        let (seconds, side) = (delay.late_s.abs(), if delay.late_s > 0.0 { "late" } else { "early" });
        let text = format!(
            "the stamps of the GNSS receiver are at least {seconds:.1} s {side} by its velocities, which is not corrected; check its \
             clock against the clock of the LiDAR"
        );
        outputs.doubt("receiver_delay", seconds, text);
    }
    let share = fixes.n_used as f64 / fixes.n.max(1) as f64;
    if share < min_used_share {
        let text = format!(
            "{} of {} fixes used ({:.0} %, limit {:.0} %): {}",
            fixes.n_used,
            fixes.n,
            100.0 * share,
            100.0 * min_used_share,
            reason(fixes, header)
        );
        outputs.doubt("few_fixes_used", share, text);
    }
}

fn reason(fixes: &FixUse, header: &PlacementHeader) -> String {
    match (fixes.n, fixes.reason()) {
        (0, _) => {
            "none is at a time of the trajectory, so the result is not georeferenced; check the clock of the receiver"
                .into()
        }
        (_, reason) if reason.is_empty() => {
            let n_rejected = header.n_fixes_refused;
            format!("{n_rejected} disagree with the rest and the odometry; the position in the world may be wrong")
        }
        (_, reason) => {
            format!("{reason}, so the result is not georeferenced; drive farther, or set correct without gnss")
        }
    }
}
