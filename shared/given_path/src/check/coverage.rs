//! Whether the path covers the drive.

use super::{Evidence, cause_of};
use crate::{GivenPath, clock};
use files::calendar::text_of_nanos;
use formats::gps_time::WEEK_NANOS;
use geometry::Stamp;

/// Seconds of a week.
const WEEK_S: i64 = WEEK_NANOS / 1_000_000_000;

pub(super) fn covers(path: &GivenPath, evidence: &Evidence) -> Result<(), String> {
    let Some(first) = evidence.first else { return Ok(()) };
    let last = evidence.last.unwrap_or(first);
    let [begin, end] = path.span();
    if begin > first || end < last {
        let missing = match (begin > first, end < last) {
            (true, true) if begin > last => format!("the whole drive, {}", span(first, last)),
            (true, _) if begin <= last => format!("the first {:.1} s of the drive", begin.seconds_since(first)),
            (false, true) if end >= first => format!("the last {:.1} s of the drive", last.seconds_since(end)),
            _ => format!("the whole drive, {}", span(first, last)),
        };
        let hint = shift_that_covers(path, first, last).map_or_else(
            || "export the path of the whole drive, or of this drive".to_owned(),
            |seconds| {
                let cause = cause_of(seconds, first).unwrap_or_default();
                format!("it would cover the drive if it were {seconds:+.0} s later; {cause}")
            },
        );
        return Err(format!("the path covers {} and not {missing}; {hint}", span(begin, end)));
    }
    path.gap_in(first, last).map_or(Ok(()), |gap| Err(gap.refusal(path.max_gap_s())))
}

fn span(begin: Stamp, end: Stamp) -> String {
    format!("{} to {}", text_of_nanos(begin.0), text_of_nanos(end.0))
}

/// The smallest of the usual time differences with which the path covers the drive, s.
fn shift_that_covers(path: &GivenPath, first: Stamp, last: Stamp) -> Option<f64> {
    let [begin, end] = path.span();
    let leaps = clock::leap_seconds(first);
    let near_weeks = ((first.0 - begin.0) as f64 / WEEK_NANOS as f64).round() as i64;
    // One cause is more likely than two.
    let single = (-14..=14)
        .map(|hours| hours * 3600)
        .chain([leaps, -leaps])
        .chain((-6..=6).map(|days| days * WEEK_S / 7))
        .chain((near_weeks - 1..=near_weeks + 1).map(|weeks| weeks * WEEK_S));
    let double = (-14..=14).flat_map(|hours| [leaps, -leaps].map(|leaps| hours * 3600 + leaps));
    let covers = |shift: &i64| {
        let nanos = shift * 1_000_000_000;
        begin.plus_nanos(nanos) <= first && end.plus_nanos(nanos) >= last
    };
    let nearest = |shifts: &mut dyn Iterator<Item = i64>| {
        shifts.filter(|shift| *shift != 0).filter(covers).min_by_key(|shift| shift.abs())
    };
    nearest(&mut single.into_iter()).or_else(|| nearest(&mut double.into_iter())).map(|shift| shift as f64)
}
