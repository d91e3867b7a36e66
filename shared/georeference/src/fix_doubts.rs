//! Doubts about the georeferencing by GNSS fixes.

use crate::Placed;
use doubts::Doubt;

/// The doubts about the fixes at the end of a drive. `counted`: fixes with and without a position. `is_expected`: the drive has a
/// receiver. `placed`: `None` without submaps. `min_used_share`: least share of fixes that must be used; 0 accepts any.
pub fn fix_doubts(counted: [u64; 2], is_expected: bool, placed: Option<&Placed>, min_used_share: f64) -> Vec<Doubt> {
    let [n_valid, n_invalid] = counted;
    if n_valid == 0 {
        let is_missed = (is_expected || n_invalid > 0) && min_used_share > 0.0;
        return is_missed.then_some(Doubt::NoUsableFix { n_invalid }).into_iter().collect();
    }
    let Some(placed) = placed else { return Vec::new() };
    let fixes = &placed.fixes;
    let delay = fixes.delay.filter(|delay| delay.is_out_of_range() && min_used_share > 0.0);
    let share = fixes.n_used as f64 / fixes.n.max(1) as f64;
    let few = (share < min_used_share).then(|| Doubt::FewFixesUsed {
        n_used: fixes.n_used,
        n: fixes.n,
        share,
        limit: min_used_share,
        reason: reason(placed),
    });
    let shape = placed.shape.clone().filter(|_| min_used_share > 0.0);
    let delay = delay.map(|delay| Doubt::ReceiverDelay { late_s: delay.late_s });
    delay.into_iter().chain(shape).chain(few).collect()
}

fn reason(placed: &Placed) -> String {
    match (placed.fixes.n, placed.fixes.reason()) {
        (0, _) => {
            "no fix is within the time of the trajectory, so the result is not georeferenced; check the clock of the receiver"
                .into()
        }
        (_, reason) if reason.is_empty() => {
            let n_rejected = placed.header.n_fixes_refused;
            format!("{n_rejected} fixes disagree with the others and the odometry; the position in the world may be wrong")
        }
        (_, reason) => {
            format!("{reason}, so the result is not georeferenced; drive farther, or set correct without gnss")
        }
    }
}
