//! Rings of a sweep whose points carry no ring numbers, derived from the order of the points.
//!
//! KITTI, SemanticKITTI and clouds made from them store one ring after the other, each a full turn in azimuth.
//! Elevations do not determine the rings: the lasers of an HDL-64E are at different heights, so the elevations of one
//! ring, seen from the origin, spread over three rings.

use crate::Directions;
use std::f32::consts::{PI, TAU};

/// Number of rings that is recognized. Fewer turns are not rings: a sweep in time order has one turn.
const RINGS: std::ops::RangeInclusive<usize> = 8..=256;
/// Azimuth sectors in which the step from ring to ring is searched.
const SECTORS: usize = 64;
/// Least share of neighboring rings whose mean slopes are in order.
const MIN_ORDERED: f64 = 0.9;

/// Rings of a sweep, by the order of its points.
#[derive(Debug, PartialEq, Eq)]
pub struct OrderedRings {
    /// Ring of each point, 0 = lowest; arbitrary for points that are not finite.
    pub by_point: Vec<u8>,
    /// Number of rings.
    pub n: usize,
}

/// The rings of points that are stored ring by ring; `None` for other orders.
pub fn rings_by_order(directions: &Directions) -> Option<OrderedRings> {
    wide_loops::run(
        #[inline(always)]
        || rings(directions),
    )
}

#[inline(always)]
fn rings(directions: &Directions) -> Option<OrderedRings> {
    let turns = Turns::from_directions(directions)?;
    let cut = turns.cut(&directions.slopes);
    let ring_at = |turned: f32| ((turned - cut) / TAU).floor() as i32;
    // The cut is accurate to a sector: a shorter piece before the first or after the last cut belongs to its neighbor.
    let margin = 2.0 * TAU / SECTORS as f32 * turns.total.signum();
    let begin = ring_at(margin);
    let end = ring_at(turns.total - margin);
    let first = begin.min(end);
    let last = begin.max(end);
    let n = (last - first + 1) as usize;
    if !RINGS.contains(&n) {
        return None;
    }
    let mut rings = vec![0; turns.turned.len()];
    for (ring, turned) in rings.iter_mut().zip(&turns.turned) {
        *ring = (ring_at(*turned).clamp(first, last) - first) as u8;
    }
    let slopes = mean_slopes(&directions.slopes, &rings, n);
    let ordered = |is_ordered: fn(f64, f64) -> bool| {
        let n_ordered = slopes.windows(2).filter(|pair| is_ordered(pair[0], pair[1])).count();
        n_ordered as f64 >= MIN_ORDERED * (slopes.len() - 1) as f64
    };
    if slopes.len() < *RINGS.start() {
        return None;
    }
    if ordered(|lower, upper| lower > upper) {
        for ring in &mut rings {
            *ring = n as u8 - 1 - *ring;
        }
        return Some(OrderedRings { by_point: rings, n });
    }
    ordered(|lower, upper| lower < upper).then_some(OrderedRings { by_point: rings, n })
}

/// Azimuth turned since the first point.
struct Turns {
    /// Turned angle per point, rad.
    turned: Vec<f32>,
    total: f32,
}

impl Turns {
    #[inline(always)]
    fn from_directions(directions: &Directions) -> Option<Self> {
        let mut turned = Vec::with_capacity(directions.slopes.len());
        let mut total = 0.0_f64;
        let mut last = None;
        for (slope, &azimuth) in directions.slopes.iter().zip(&directions.azimuths) {
            if !slope.is_nan() {
                let step = azimuth - last.unwrap_or(azimuth);
                total += f64::from(if step > PI {
                    step - TAU
                } else if step < -PI {
                    step + TAU
                } else {
                    step
                });
                last = Some(azimuth);
            }
            turned.push(total as f32);
        }
        let total = total as f32;
        (total.abs() > *RINGS.start() as f32 * TAU - PI).then_some(Self { turned, total })
    }
    /// The angle, from the first point on, at which the rings change: there the slope has a step in most turns. Edges of
    /// objects, seen by lasers at different heights, have larger steps in some turns.
    #[inline(always)]
    fn cut(&self, slopes: &[f32]) -> f32 {
        let n_turns = (self.total.abs() / TAU) as usize + 2;
        let mut changes = vec![vec![0.0_f32; n_turns]; SECTORS];
        let mut largest = vec![vec![Step::default(); n_turns]; SECTORS];
        let mut before = None;
        for (&slope, &turned) in slopes.iter().zip(&self.turned) {
            if slope.is_nan() {
                continue;
            }
            let [slope_before, turned_before] = before.unwrap_or([slope, turned]);
            let turns = turned / TAU;
            let sector = ((turns - turns.floor()) * SECTORS as f32) as usize % SECTORS;
            let turn = (turns.abs() as usize).min(n_turns - 1);
            let change = slope - slope_before;
            changes[sector][turn] += change;
            if change.abs() > largest[sector][turn].slope.abs() {
                let start = (turns.floor() + sector as f32 / SECTORS as f32) * TAU;
                largest[sector][turn] = Step { slope: change, angle: f32::midpoint(turned, turned_before) - start };
            }
            before = Some([slope, turned]);
        }
        let medians = changes.into_iter().map(median);
        let found = medians.enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (sector, step) = found.unwrap_or((0, 0.0));
        let angles = largest[sector].iter().filter(|found| found.slope * step > 0.0).map(|found| found.angle);
        sector as f32 / SECTORS as f32 * TAU + median(angles.collect())
    }
}

/// The largest change of the slope from point to point within a sector of a turn.
#[derive(Clone, Copy, Default)]
struct Step {
    slope: f32,
    /// Angle from the start of the sector, rad.
    angle: f32,
}

/// The median; 0 without values.
fn median(mut values: Vec<f32>) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// Mean slope of each ring that has points.
#[inline(always)]
fn mean_slopes(slopes: &[f32], rings: &[u8], n: usize) -> Vec<f64> {
    let mut sums = vec![0.0; n];
    let mut n_points = vec![0_u32; n];
    for (slope, ring) in slopes.iter().zip(rings) {
        if !slope.is_nan() {
            sums[usize::from(*ring)] += f64::from(*slope);
            n_points[usize::from(*ring)] += 1;
        }
    }
    sums.into_iter().zip(n_points).filter(|(_, n)| *n > 0).map(|(sum, n)| sum / f64::from(n)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points with their true rings.
    struct StoredRings {
        positions: Vec<[f32; 3]>,
        rings: Vec<u8>,
    }

    /// Rings from the highest to the lowest, each a turn that starts at `begin` rad; every seventh point is missing.
    fn ring_by_ring(n_rings: u8, begin: f32) -> StoredRings {
        let mut positions = Vec::new();
        let mut rings = Vec::new();
        for ring in (0..n_rings).rev() {
            for col in (0..900_u16).filter(|col| (col + u16::from(ring)) % 7 != 0) {
                let azimuth = begin + f32::from(col) / 900.0 * TAU;
                // Walls at different ranges, and a laser above the origin.
                let range = 10.0 + 5.0 * (3.0 * azimuth).sin();
                let z = range * (-0.4 + 0.007 * f32::from(ring)) + 0.1;
                positions.push([range * azimuth.cos(), range * azimuth.sin(), z]);
                rings.push(ring);
            }
        }
        StoredRings { positions, rings }
    }

    fn found(positions: &[[f32; 3]]) -> Option<OrderedRings> {
        rings_by_order(&Directions::new(positions, |position| *position))
    }

    #[test]
    fn points_stored_ring_by_ring_get_their_rings() {
        for begin in [0.0, 2.0, -PI] {
            let StoredRings { positions, rings: truth } = ring_by_ring(64, begin);
            let OrderedRings { by_point: rings, n } = found(&positions).expect("rings in order");
            let n_wrong = rings.iter().zip(&truth).filter(|(ring, truth)| ring != truth).count();
            assert!(n == 64 && n_wrong * 50 < positions.len(), "begin {begin}: {n} rings, {n_wrong} wrong");
        }
    }

    #[test]
    fn points_in_the_order_of_time_have_no_rings_by_order() {
        let mut positions = ring_by_ring(32, 0.0).positions;
        positions.sort_by(|a, b| f32::atan2(a[1], a[0]).total_cmp(&f32::atan2(b[1], b[0])));
        assert_eq!(found(&positions), None);
        assert_eq!(found(&[]), None);
    }
}
