//! Places of the path against the fixes of the receiver: frame, height, clock.

use super::median::median;
use super::{Evidence, cause_of};
use crate::GivenPath;
use crate::clock::leap_seconds;
use geometry::{Geodetic, Stamp, Vector3};

/// Largest median distance, m: a code receiver in a street.
const MAX_DISTANCE_M: f64 = 15.0;
/// Largest median difference of height, m: heights of a code receiver, and of local height systems.
const MAX_HEIGHT_M: f64 = 12.0;
/// Least number of fixes.
const MIN_FIXES: usize = 5;
/// Fixes that are compared at most.
const MAX_FIXES: usize = 2000;
/// Another reading must reduce the median distance by this factor.
const MIN_GAIN: f64 = 3.0;
/// A difference of time is found by distances only above this speed, m/s.
const MIN_SPEED_MPS: f64 = 2.0;

/// Median differences between path and fixes.
struct Difference {
    horizontal_m: f64,
    /// Path above fixes.
    height_m: f64,
    n: usize,
}

pub(super) fn agrees(path: &GivenPath, evidence: &Evidence) -> Result<String, String> {
    let Some(local) = path.local_frame() else {
        return Ok("places not compared: the path is in a local frame".into());
    };
    let fixes = placed(evidence);
    let place = |fix: &PlacedFix, swap: bool| {
        let [lat, lon] = if swap { [fix.position_deg[1], fix.position_deg[0]] } else { fix.position_deg };
        Geodetic::new(lat, lon, fix.altitude_m).map(|place| local.world_from_geodetic(&place).coords)
    };
    let measured: Vec<Measured> =
        fixes.iter().filter_map(|fix| Some(Measured { stamp: fix.stamp, position: place(fix, false)? })).collect();
    let Some(now) = difference(path, evidence, &measured, 0.0) else {
        return Ok("places not compared: fewer than five fixes with heights within the time of the path".into());
    };
    let Difference { horizontal_m, height_m, n } = now;
    let distance_m = horizontal_m;
    let at = measured[0].stamp;
    if distance_m > 2.0 && speed(path, &measured) > MIN_SPEED_MPS {
        let leaps = leap_seconds(at) as f64;
        let hours = (-14..=14).map(|hours| f64::from(hours) * 3600.0);
        let shifts = hours.flat_map(|hour| [hour, hour + leaps, hour - leaps]).filter(|shift| *shift != 0.0);
        let best = shifts
            .filter_map(|late_s| Some((late_s, difference(path, evidence, &measured, late_s)?.horizontal_m)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((late_s, there_m)) = best
            && there_m * MIN_GAIN < distance_m
            && there_m < MAX_DISTANCE_M
        {
            let cause = cause_of(late_s, at).unwrap_or_default();
            let side = if late_s > 0.0 { "late" } else { "early" };
            return Err(format!(
                "the path is {:.0} s {side}, by the fixes: at the times of drive.toml they are {distance_m:.1} m apart, with this shift \
                 {there_m:.1} m; {cause}",
                late_s.abs()
            ));
        }
    }
    if distance_m > MAX_DISTANCE_M {
        let exchanged: Vec<Measured> =
            fixes.iter().filter_map(|fix| Some(Measured { stamp: fix.stamp, position: place(fix, true)? })).collect();
        let is_exchanged = difference(path, evidence, &exchanged, 0.0)
            .is_some_and(|there| there.horizontal_m < MAX_DISTANCE_M.max(distance_m * 0.01));
        let hint = if is_exchanged {
            "latitude and longitude are exchanged"
        } else {
            "it may be the path of another drive, or trajectory.frame or trajectory.origin is wrong"
        };
        return Err(format!("the path is {distance_m:.0} m from the fixes (median of {n}); {hint}"));
    }
    if height_m.abs() > MAX_HEIGHT_M {
        let side = if height_m < 0.0 { "below" } else { "above" };
        return Err(format!(
            "the path is {:.1} m {side} the fixes, which agree horizontally; its heights may be above the geoid: set trajectory.geoid_m to the \
             height of the geoid above the ellipsoid, about {:.0} m",
            height_m.abs(),
            -height_m
        ));
    }
    Ok(format!("places agree with {n} fixes (median distance {distance_m:.1} m, height {height_m:+.1} m)"))
}

/// A fix with a height.
struct PlacedFix {
    stamp: Stamp,
    position_deg: [f64; 2],
    altitude_m: f64,
}

struct Measured {
    stamp: Stamp,
    position: Vector3<f64>,
}

fn placed(evidence: &Evidence) -> Vec<PlacedFix> {
    let with_height = evidence.fixes.iter().filter(|fix| fix.quality != 0).filter_map(|fix| {
        Some(PlacedFix { stamp: fix.stamp, position_deg: fix.position_deg, altitude_m: fix.altitude_m? })
    });
    let all: Vec<PlacedFix> = with_height.collect();
    let stride = all.len() / MAX_FIXES + 1;
    all.into_iter().step_by(stride).collect()
}

/// Median differences if the path is `late_s` late; `None` with too few fixes within its time.
fn difference(path: &GivenPath, evidence: &Evidence, fixes: &[Measured], late_s: f64) -> Option<Difference> {
    let late_nanos = (late_s * 1e9) as i64;
    let error = |fix: &Measured| {
        let pose = path.at(fix.stamp.plus_nanos(late_nanos))?;
        Some((pose * evidence.antenna_in_body).coords - fix.position)
    };
    let errors: Vec<Vector3<f64>> = fixes.iter().filter_map(error).collect();
    if errors.len() < MIN_FIXES || errors.len() * 2 < fixes.len() {
        return None;
    }
    Some(Difference {
        horizontal_m: median(errors.iter().map(|error| error.xy().norm()).collect()),
        height_m: median(errors.iter().map(|error| error.z).collect()),
        n: errors.len(),
    })
}

/// Mean speed of the path over the time of the fixes, m/s.
fn speed(path: &GivenPath, fixes: &[Measured]) -> f64 {
    let positions: Vec<(Stamp, Vector3<f64>)> =
        fixes.iter().filter_map(|fix| Some((fix.stamp, path.at(fix.stamp)?.translation.vector))).collect();
    let Some(((first, _), (last, _))) = positions.first().zip(positions.last()) else { return 0.0 };
    let length: f64 = positions.windows(2).map(|pair| (pair[1].1 - pair[0].1).norm()).sum();
    length / last.seconds_since(*first).max(1.0)
}
