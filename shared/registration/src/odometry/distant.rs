//! Matches of sweeps that are far apart: a sensor at 2 Hz, or lost sweeps.

use crate::map::local_map::MAX_RADIUS_M;
use crate::{MatchScale, MatchSettings};
use std::borrow::Cow;

/// Time between two sweeps above which they are distant, s: a sensor at 10 Hz that lost no sweep stays below.
const DISTANT_S: f64 = 0.15;

/// Longest time over which a motion is searched, s: a sensor at 1 Hz. Later a vehicle may be anywhere, and repeated facades fit at a
/// wrong place.
pub(super) const MAX_DISTANT_S: f64 = 1.2;

/// Whether sweeps this far apart in time are distant, but within reach.
pub(super) fn is_distant(seconds: f64) -> bool {
    seconds > DISTANT_S && seconds <= MAX_DISTANT_S
}

/// The settings for a sweep, `seconds` after the last one.
///
/// A map of distant sweeps has few points: the fine radius is the largest one. Each fifth sweep of muehlburger, 150 to 340, has 38
/// of 38 right steps with it, and 20 with 0.3 m.
pub(super) fn settings_at(settings: &MatchSettings, seconds: f64) -> Cow<'_, MatchSettings> {
    if !is_distant(seconds) {
        return Cow::Borrowed(settings);
    }
    let fine = MatchScale { radius_m: settings.fine.radius_m.max(MAX_RADIUS_M), ..settings.fine };
    Cow::Owned(MatchSettings { fine, ..settings.clone() })
}
