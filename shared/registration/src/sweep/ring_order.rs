//! Rings of a sweep whose points carry no ring numbers, derived from the order of the points.
//!
//! KITTI, SemanticKITTI and clouds made from them store one ring after the other, each a full turn in azimuth.
//! Elevations do not determine the rings: the lasers of an HDL-64E are at different heights, so the elevations of one
//! ring, seen from the origin, spread over three rings.

use crate::sweep::directions::Directions;
use std::f32::consts::{PI, TAU};

/// Number of rings that is recognized. Fewer turns are not rings: a sweep in time order has one turn.
const RINGS: std::ops::RangeInclusive<usize> = 8..=256;
/// Azimuth sectors in which the step from ring to ring is searched.
const SECTORS: usize = 64;
/// Least share of neighboring rings whose mean slopes are in order.
const MIN_ORDERED: f64 = 0.9;

/// Rings of a sweep.
#[derive(Debug, PartialEq)]
pub(crate) struct Rings {
    /// Ring of each point, 0 = lowest; arbitrary for points that are not finite.
    pub by_point: Vec<u8>,
    /// Number of rings.
    pub n: usize,
}

/// The rings of points that are stored ring by ring; `None` for other orders.
pub(crate) fn rings_by_order(directions: &Directions) -> Option<Rings> {
    wide_loops::run(
        #[inline(always)]
        || rings(directions),
    )
}

#[inline(always)]
fn rings(directions: &Directions) -> Option<Rings> {
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
        return Some(Rings { by_point: rings, n });
    }
    ordered(|lower, upper| lower < upper).then_some(Rings { by_point: rings, n })
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
    /// The angle, from the first point on, at which the rings change: the slope has a step there.
    #[inline(always)]
    fn cut(&self, slopes: &[f32]) -> f32 {
        let mut steps = [0.0; SECTORS];
        let sector = |turned: f32| {
            let turns = turned / TAU;
            ((turns - turns.floor()) * SECTORS as f32) as usize % SECTORS
        };
        let mut last = None;
        for (&slope, turned) in slopes.iter().zip(&self.turned) {
            if !slope.is_nan() {
                steps[sector(*turned)] += slope - last.unwrap_or(slope);
                last = Some(slope);
            }
        }
        let greatest = (0..SECTORS).max_by(|a, b| steps[*a].abs().total_cmp(&steps[*b].abs())).unwrap_or(0);
        (greatest as f32 + 0.5) / SECTORS as f32 * TAU
    }
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
    use crate::TimedPoint;

    /// Points with their true rings.
    struct StoredRings {
        points: Vec<TimedPoint>,
        rings: Vec<u8>,
    }

    /// Rings from the highest to the lowest, each a turn that starts at `begin` rad; every seventh point is missing.
    fn ring_by_ring(n_rings: u8, begin: f32) -> StoredRings {
        let mut points = Vec::new();
        let mut rings = Vec::new();
        for ring in (0..n_rings).rev() {
            for col in (0..900_u16).filter(|col| (col + u16::from(ring)) % 7 != 0) {
                let azimuth = begin + f32::from(col) / 900.0 * TAU;
                // Walls at different ranges, and a laser above the origin.
                let range = 10.0 + 5.0 * (3.0 * azimuth).sin();
                let z = range * (-0.4 + 0.007 * f32::from(ring)) + 0.1;
                points.push(TimedPoint {
                    position: [range * azimuth.cos(), range * azimuth.sin(), z],
                    offset_nanos: 0,
                    ring: 0,
                });
                rings.push(ring);
            }
        }
        StoredRings { points, rings }
    }

    #[test]
    fn points_stored_ring_by_ring_get_their_rings() {
        for begin in [0.0, 2.0, -PI] {
            let StoredRings { points, rings: truth } = ring_by_ring(64, begin);
            let Rings { by_point: rings, n } =
                rings_by_order(&Directions::from_points(&points)).expect("rings in order");
            let n_wrong = rings.iter().zip(&truth).filter(|(ring, truth)| ring != truth).count();
            assert!(n == 64 && n_wrong * 50 < points.len(), "begin {begin}: {n} rings, {n_wrong} wrong");
        }
    }

    #[test]
    fn points_in_the_order_of_time_have_no_rings_by_order() {
        let mut points = ring_by_ring(32, 0.0).points;
        points.sort_by(|a, b| {
            f32::atan2(a.position[1], a.position[0]).total_cmp(&f32::atan2(b.position[1], b.position[0]))
        });
        assert_eq!(rings_by_order(&Directions::from_points(&points)), None);
        assert_eq!(rings_by_order(&Directions::from_points(&[])), None);
    }
}
