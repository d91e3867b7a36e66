//! Two receivers in one log whose epochs differ: their fixes alternate, and the path of the log goes back and forth between
//! two antennas.

use super::Fix;
use geometry::{Geodetic, LocalFrame, Stamp};
use std::collections::BTreeMap;

/// Longest time between a fix and its neighbours, ns.
const MAX_PAUSE_NANOS: i64 = 3_000_000_000;
/// Stamps are compared in steps of this time, ns: receivers compute at fixed times of the second.
const PHASE_NANOS: i64 = 10_000_000;
const SECOND_NANOS: i64 = 1_000_000_000;
/// Most times of a second that are compared.
const MAX_PHASES: usize = 20;
/// Fixes of each group in a window, in which the vehicle hardly turns.
const OF_GROUP: usize = 8;
/// Least distance of two antennas, m: a receiver that computes twice a second has up to 0.2 m.
const MIN_APART_M: f64 = 1.0;
/// Share of a group in which few of the others have a neighbour.
const RARE_SHARE: f64 = 0.2;
/// Least distance in standard errors of the groups.
const MIN_SIGNIFICANCE: f64 = 6.0;

/// Fixes that lie to one side of the fixes before and after them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Alternation {
    /// Number of these fixes.
    pub n_fixes: u64,
    /// Their distance from the others, m.
    pub apart_m: f64,
}

/// Offset of a fix from the line between its neighbours, m to east and north, and the group of the fix.
#[derive(Clone, Copy)]
struct Offset {
    east_north: [f64; 2],
    is_in_group: bool,
}

/// The alternation of every second fix, or with the largest distance of a time of the second; `None` if the fixes are from one receiver.
pub(super) fn alternation(fixes: &[Fix]) -> Option<Alternation> {
    let offsets = offsets(fixes);
    let phase_of = |stamp: Stamp| stamp.0.rem_euclid(SECOND_NANOS) / PHASE_NANOS;
    let mut phases: BTreeMap<i64, usize> = BTreeMap::new();
    for fix in fixes {
        *phases.entry(phase_of(fix.stamp)).or_default() += 1;
    }
    let every_second = found(&offsets, 2, |index| index % 2 == 0);
    let n_phases = phases.len();
    let is_regular = (2..=MAX_PHASES).contains(&n_phases);
    let of_phases = phases.into_keys().filter(|_| is_regular);
    let at_phase = |phase| found(&offsets, n_phases, move |index| phase_of(fixes[index].stamp) == phase);
    every_second.or_else(|| of_phases.filter_map(at_phase).max_by(|a, b| a.apart_m.total_cmp(&b.apart_m)))
}

/// The offsets of all fixes, by their index; `None` without close neighbours.
fn offsets(fixes: &[Fix]) -> Vec<Option<[f64; 2]>> {
    let place = |fix: &Fix| {
        let [latitude_deg, longitude_deg] = fix.position_deg;
        Geodetic { latitude_deg, longitude_deg, altitude_m: 0.0 }
    };
    let offset = |index: usize| {
        let [before, at, after] = [index.checked_sub(1)?, index, index + 1].map(|index| fixes.get(index));
        let (before, at, after) = (before?, at?, after?);
        let pauses = [at.stamp.0 - before.stamp.0, after.stamp.0 - at.stamp.0];
        if !pauses.iter().all(|pause| (1..=MAX_PAUSE_NANOS).contains(pause)) {
            return None;
        }
        let part = pauses[0] as f64 / (pauses[0] + pauses[1]) as f64;
        let frame = LocalFrame::new(place(at));
        let [before, after] = [before, after].map(|fix| frame.world_from_geodetic(&place(fix)));
        Some([0, 1].map(|axis| -before[axis] - part * (after[axis] - before[axis])))
    };
    (0..fixes.len()).map(offset).collect()
}

/// Whether the fixes of a group, one of `n_groups`, lie to one side of the others in most windows.
fn found(offsets: &[Option<[f64; 2]>], n_groups: usize, is_in_group: impl Fn(usize) -> bool) -> Option<Alternation> {
    let grouped = offsets
        .iter()
        .enumerate()
        .filter_map(|(index, offset)| Some(Offset { east_north: (*offset)?, is_in_group: is_in_group(index) }));
    let grouped: Vec<Offset> = grouped.collect();
    let windows = grouped.chunks_exact(n_groups * OF_GROUP);
    let n_windows = windows.len();
    let mut apart_m: Vec<f64> = windows.filter_map(window_apart_m).collect();
    if 2 * apart_m.len() <= n_windows {
        return None;
    }
    let n_fixes = grouped.iter().filter(|offset| offset.is_in_group).count() as u64;
    Some(Alternation { n_fixes, apart_m: median(&mut apart_m)? })
}

/// Distance of the group from the others in a window, if it is significant.
fn window_apart_m(window: &[Offset]) -> Option<f64> {
    let mut squared_m = 0.0;
    let mut squared_error_m = 0.0;
    for axis in [0, 1] {
        let group = |is_in_group: bool| {
            let of = window.iter().filter(move |offset| offset.is_in_group == is_in_group);
            GroupValue::new(of.map(|offset| offset.east_north[axis]).collect())
        };
        let (inside, outside) = (group(true)?, group(false)?);
        squared_m += (inside.median_m - outside.median_m).powi(2);
        squared_error_m += inside.error_m.powi(2) + outside.error_m.powi(2);
    }
    let share = window.iter().filter(|offset| offset.is_in_group).count() as f64 / window.len() as f64;
    // If the groups alternate, each of them is a neighbour of the other, and both offsets are the distance. Neighbours of rare fixes
    // are fixes of the other group.
    let apart_m = squared_m.sqrt() / if share < RARE_SHARE { 1.0 } else { 1.0 + (2.0 * share).min(1.0) };
    (apart_m > MIN_APART_M && squared_m.sqrt() > MIN_SIGNIFICANCE * squared_error_m.sqrt()).then_some(apart_m)
}

/// Median of some offsets, m, and its standard error.
struct GroupValue {
    median_m: f64,
    error_m: f64,
}

impl GroupValue {
    /// `None` for too few offsets.
    fn new(mut values: Vec<f64>) -> Option<Self> {
        if values.len() < OF_GROUP / 2 {
            return None;
        }
        let median_m = median(&mut values)?;
        let mut deviations: Vec<f64> = values.iter().map(|value| (value - median_m).abs()).collect();
        // Of a normal distribution: 1.48 median deviations, and 1.25 / sqrt(n) for the median.
        let error_m = 1.48 * 1.25 * median(&mut deviations)? / (values.len() as f64).sqrt();
        Some(Self { median_m, error_m })
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive at 8 m/s with a bend. `antenna`: time of the second, ns, and offset of each epoch's antenna, m.
    fn fixes(n: usize, epochs: &[(i64, f64)], error_m: f64) -> Vec<Fix> {
        let fix = |number: usize| {
            let (phase, left_m) = epochs[number % epochs.len()];
            let nanos = (number / epochs.len()) as i64 * SECOND_NANOS + phase;
            let second = nanos as f64 * 1e-9;
            let error = [(number as f64 * 12.9).sin(), (number as f64 * 78.2).cos()].map(|error| error * error_m);
            let heading = 0.02 * second;
            let [x, y] = [400.0 * heading.sin(), 400.0 * (1.0 - heading.cos())];
            let [east, north] = [x - left_m * heading.sin() + error[0], y + left_m * heading.cos() + error[1]];
            Fix {
                stamp: Stamp(1_700_000_000_000_000_000 + nanos),
                position_deg: [48.85 + north / 111_195.0, 2.35 + east / 111_195.0 / 48.85_f64.to_radians().cos()],
                altitude_m: Some(90.0),
                speed_mps: None,
                course_deg: None,
                hdop: None,
                satellites: 9,
                quality: 1,
                vdop: None,
                deviation: None,
            }
        };
        (0..n).map(fix).collect()
    }

    #[test]
    fn receivers_of_different_epochs_are_found_with_their_distance() {
        // Both at 1 Hz; 5 Hz and 1 Hz; both at 2 Hz.
        let tenths =
            |epochs: &[(i64, f64)]| epochs.iter().map(|(tenth, m)| (tenth * 100_000_000, *m)).collect::<Vec<_>>();
        for epochs in [
            tenths(&[(0, 0.0), (3, 2.5)]),
            tenths(&[(0, 0.0), (2, 0.0), (4, 0.0), (5, 2.5), (6, 0.0), (8, 0.0)]),
            tenths(&[(0, 0.0), (2, 2.5), (5, 0.0), (7, 2.5)]),
        ] {
            for error_m in [0.0, 0.3] {
                let found = alternation(&fixes(240, &epochs, error_m)).expect("is found");
                assert!((2.0..3.2).contains(&found.apart_m), "{found:?} {epochs:?}");
            }
            let one: Vec<_> = epochs.iter().map(|(phase, _)| (*phase, 0.0)).collect();
            for error_m in [0.0, 0.3, 3.0] {
                assert_eq!(alternation(&fixes(240, &one, error_m)), None, "{error_m} {epochs:?}");
            }
        }
        assert_eq!(alternation(&fixes(240, &[(0, 0.0)], 2.0)), None);
        assert_eq!(alternation(&[]), None);
    }
}
