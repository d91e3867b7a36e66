//! Sweeps of a cloud that has positions of the scanner and times.

use super::points::CloudPoint;
use super::sweep::{Sweep, difference};
use super::sweeps::{Rule, Sweeps};
use messages::MAX_SWEEPS_PER_SUBMAP;
use std::collections::BTreeMap;

/// Duration of a sweep, s.
const SWEEP_S: f64 = 0.1;
/// Length of a tile along the path, m.
const TILE_M: f64 = 20.0;
/// Maximum number of points of a tile, unless a single sweep has more.
const TILE_POINTS: u64 = 1 << 22;
/// Maximum number of sweeps of a cloud: 29 hours.
const MAX_BINS: usize = 1 << 20;

/// Number of the sweep that contains a time.
pub(super) fn bin(time_s: f64) -> i64 {
    (time_s / SWEEP_S).floor() as i64
}

/// Converts a time of the file to ns.
pub(super) fn nanos(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// Position of the scanner at a time.
#[derive(Clone, Copy)]
struct Moment {
    time_s: f64,
    position: [f64; 3],
}

struct Bin {
    first: Moment,
    last: Moment,
    n_points: u64,
}

/// The path of the scanner by tenths of a second. Memory: bounded by the duration of the drive.
#[derive(Default)]
pub(super) struct Bins {
    by_number: BTreeMap<i64, Bin>,
}

impl Bins {
    /// Adds a point. Fails if the times span too many sweeps.
    pub fn add(&mut self, point: &CloudPoint) -> Result<(), String> {
        let Some(position) = point.scanner.filter(|_| point.is_valid()) else { return Ok(()) };
        let now = Moment { time_s: point.time_s, position };
        let bin = self.by_number.entry(bin(point.time_s)).or_insert(Bin { first: now, last: now, n_points: 0 });
        bin.n_points += 1;
        if now.time_s < bin.first.time_s {
            bin.first = now;
        }
        if now.time_s > bin.last.time_s {
            bin.last = now;
        }
        if self.by_number.len() > MAX_BINS {
            return Err(format!("the times of its points fill {MAX_BINS} sweeps of {SWEEP_S} s; are they in seconds?"));
        }
        Ok(())
    }

    /// The sweeps. Times that begin before `next_stamp` are shifted: files of a data set may begin at the same time.
    pub fn sweeps(&self, next_stamp: i64) -> Sweeps {
        let begin = self.by_number.values().next().map_or(0, |bin| nanos(bin.first.time_s));
        // Saturates for the times of damaged files, whose points are then invalid.
        let shift_nanos = next_stamp.saturating_sub(begin).max(0);
        let mut all = Vec::new();
        let mut tiles = Vec::new();
        let mut tile = 0..0;
        let mut length_m = 0.0;
        let mut n_points = 0;
        for bin in self.by_number.values() {
            let stamp = nanos(bin.first.time_s).saturating_add(shift_nanos);
            let duration_nanos = (nanos(bin.last.time_s) - nanos(bin.first.time_s)) as u32;
            let sweep = Sweep { stamp, duration_nanos, begin: bin.first.position, end: bin.last.position };
            let step_m = all.last().map_or(0.0, |before: &Sweep| norm(difference(sweep.begin, before.begin)));
            length_m += step_m;
            n_points += bin.n_points;
            let is_full = length_m > TILE_M || n_points > TILE_POINTS || tile.len() == MAX_SWEEPS_PER_SUBMAP;
            if is_full && !tile.is_empty() {
                tiles.push(tile.clone());
                tile = all.len()..all.len();
                length_m = 0.0;
                n_points = bin.n_points;
            }
            all.push(sweep);
            tile.end = all.len();
        }
        if !tile.is_empty() {
            tiles.push(tile);
        }
        let bins = self.by_number.keys().copied().collect();
        Sweeps { all, tiles, rule: Rule::Time { bins, shift_nanos } }
    }
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|value| value * value).sum::<f64>().sqrt()
}
