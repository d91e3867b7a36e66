//! From fixes of a receiver to positions in submaps.

use crate::recent_path::RecentPath;
use geometry::{Geodetic, LocalFrame, Point3, Pose, Vector3};
use messages::GnssRow;
use pose_graph::{Position, Sighting};
use serde::{Deserialize, Serialize};

/// Fixes within this time are one measurement, s: a house is passed in it, and what it reflects lasts as long.
const ERRORS_LAST_S: f64 = 8.0;
/// Fixes nearer in time are left out, ns: they say nothing new.
const LEAST_PAUSE_NANOS: i64 = 450_000_000;
/// Heights are this much worse than places: satellites are above only.
const VERTICAL: f64 = 1.8;
/// And heights above the truth this much worse than those below: what comes by way of a wall is late and never early, and it is
/// the low satellites that do.
const ABOVE: f64 = 6.0;
/// Drifts against the odometry are taken over this time on either side, ns, and up to the next fix at least.
const DRIFT_NANOS: i64 = 2_000_000_000;
/// A receiver's noise and the odometry's drift as much as this, m/s.
const FREE_DRIFT_MPS: f64 = 0.05;
/// A fix that drifts is on its way to or from a wrong place: each such drift beyond the free one adds its deviation once, m/s.
const DOUBTED_DRIFT_MPS: f64 = 0.03;
/// What drifts faster is as wrong as what drifts so fast, m/s: a jump spoils its neighbors, too.
const MOST_DRIFT_MPS: f64 = 1.0;
/// Dilution where the receiver does not tell.
const USUAL_HDOP: f64 = 2.0;

/// Collects fixes; part of the stage's state.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Fixes {
    /// Those whose time the odometry has not reached.
    waiting: Vec<(i64, Geodetic, f64)>,
    /// Zero of the world.
    origin: Option<Geodetic>,
    /// Of each position, when it was, ns, and where the odometry saw the antenna.
    settled: Vec<(i64, Point3<f64>)>,
}

/// How far fixes scatter about their common error along one axis of the ground at a dilution of 1, m, by GGA's quality: code
/// alone, code with corrections, carrier phases fixed and not. It decides which fixes fit together, so what they have in
/// common (orbits, the air: 1 to 2 m of code alone) is left out: nothing in the drive can tell it.
const fn sigma_m(quality: u32) -> Option<f64> {
    match quality {
        0 => None,
        2 => Some(0.2),
        4 => Some(0.02),
        5 => Some(0.15),
        _ => Some(0.6),
    }
}

impl Fixes {
    /// `origin` of the drive's world, if its recording names one; the first fix's place otherwise.
    pub fn with_origin(origin: Option<Geodetic>) -> Self {
        Self { origin, ..Self::default() }
    }
    pub const fn origin(&self) -> Option<Geodetic> {
        self.origin
    }
    /// Takes a fix. `false` if it is none.
    pub fn push(&mut self, row: &GnssRow) -> bool {
        let place = Geodetic::new(row.latitude_deg, row.longitude_deg, row.altitude_m);
        let (Some(place), Some(sigma_m)) = (place, sigma_m(row.quality)) else { return false };
        let hdop = if row.hdop > 0.0 { f64::from(row.hdop) } else { USUAL_HDOP };
        self.waiting.push((row.stamp, place, sigma_m * hdop.max(0.5)));
        true
    }
    /// Positions of the fixes that the odometry has passed. `submap_at` tells number and `odom_from_submap` of the submap of a
    /// stamp.
    pub fn settle(
        &mut self,
        path: &RecentPath,
        antenna_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<(usize, Pose)>,
        positions: &mut Vec<Position>,
    ) {
        let Some(end) = path.last() else { return };
        let n_passed = self.waiting.iter().take_while(|(stamp, ..)| *stamp <= end).count();
        for (stamp, place, sigma) in self.waiting.drain(..n_passed) {
            let pause = self.settled.last().map_or(i64::MAX, |(last, _)| stamp.saturating_sub(*last));
            let (Some(pose), Some((submap, odom_from_submap))) = (path.at(stamp), submap_at(stamp)) else { continue };
            if pause < LEAST_PAUSE_NANOS {
                continue;
            }
            let origin = *self.origin.get_or_insert(place);
            let antenna_in_odom = pose * antenna_in_body;
            positions.push(Position {
                submap,
                p_in_submap: odom_from_submap.inverse() * antenna_in_odom,
                p_in_world: LocalFrame::new(origin).world_from_geodetic(&place),
                sigma_m: [sigma, sigma, VERTICAL * sigma],
                sigma_above_m: ABOVE * VERTICAL * sigma,
                share: (pause as f64 * 1e-9 / ERRORS_LAST_S).min(1.0),
            });
            self.settled.push((stamp, antenna_in_odom));
        }
    }
    /// Raises the deviations of positions that drift against the submaps, which lie at `world_from_submap` by number.
    pub fn doubt(&self, positions: &mut [Position], world_from_submap: &[Pose]) {
        let off = |p: &Position| p.p_in_world - world_from_submap[p.submap] * p.p_in_submap;
        let stamps = self.settled.iter().map(|(stamp, _)| *stamp);
        let offs: Vec<(i64, Vector3<f64>)> = stamps.zip(positions.iter().map(off)).collect();
        for (number, position) in positions.iter_mut().enumerate() {
            let stamp = offs[number].0;
            let n_before = offs.partition_point(|(at, _)| *at < stamp - DRIFT_NANOS);
            let n_until = offs.partition_point(|(at, _)| *at <= stamp + DRIFT_NANOS);
            let (begin, before) = offs[n_before.min(number.saturating_sub(1))];
            let (end, after) = offs[n_until.max(number + 2).min(offs.len()) - 1];
            // A fix that is the only one is measured against itself.
            let drift_mps = (after - before).norm() / ((end - begin) as f64 * 1e-9).max(1e-3);
            let factor = 1.0 + (drift_mps.min(MOST_DRIFT_MPS) - FREE_DRIFT_MPS).max(0.0) / DOUBTED_DRIFT_MPS;
            position.sigma_m = position.sigma_m.map(|sigma| sigma * factor);
            position.sigma_above_m *= factor;
        }
    }
    /// The positions as the odometry and as the receiver saw them.
    pub fn sightings(&self, positions: &[Position]) -> Vec<Sighting> {
        let pairs = self.settled.iter().zip(positions);
        pairs.map(|((_, odom), position)| Sighting { p_in_odom: *odom, p_in_world: position.p_in_world }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Isometry3;

    const SECOND: i64 = 1_000_000_000;

    /// Factors by which the deviations of fixes rise whose errors to the east are these, on a straight way.
    fn doubts(fixes: &[(i64, f64)]) -> Vec<f64> {
        let world_from_submap = Isometry3::translation(100.0, 50.0, 3.0);
        let at = |second: i64| Point3::new(8.0 * second as f64, 0.0, 1.8);
        let position = |(second, error): &(i64, f64)| Position {
            submap: 0,
            p_in_submap: at(*second),
            p_in_world: world_from_submap * at(*second) + Vector3::x() * *error,
            sigma_m: [0.2, 0.2, 0.4],
            sigma_above_m: 2.4,
            share: 1.0,
        };
        let mut positions: Vec<Position> = fixes.iter().map(position).collect();
        let settled = fixes.iter().map(|(second, _)| (second * SECOND, at(*second))).collect();
        Fixes { settled, ..Fixes::default() }.doubt(&mut positions, &[world_from_submap]);
        assert!(positions.iter().all(|p| (p.sigma_above_m / p.sigma_m[0] - 12.0).abs() < 1e-9));
        positions.iter().map(|p| p.sigma_m[0] / 0.2).collect()
    }

    #[test]
    fn fixes_that_drift_are_doubted_and_those_that_keep_their_error_are_not() {
        // Wandering off from the tenth second on, by 0.35 m/s, to stay 3.5 m off; then without a fix, and one alone.
        let error = |second: i64| 0.35 * (second - 10).clamp(0, 10) as f64;
        let mut fixes: Vec<(i64, f64)> = (0..30).map(|second| (second, error(second))).collect();
        fixes.extend([(60, 3.5), (90, 33.5)]);
        let doubts = doubts(&fixes);
        for steady in (0..=8).chain(22..30) {
            assert!((doubts[steady] - 1.0).abs() < 1e-9, "{steady}: {}", doubts[steady]);
        }
        for (drifting, doubt) in doubts.iter().enumerate().take(19).skip(12) {
            assert!((doubt - 11.0).abs() < 1e-6, "{drifting}: {doubt}");
        }
        assert!(doubts[11] > 5.0 && doubts[11] < 11.0);
        // Half a metre a second over the minute between its neighbors, a metre a second since the last.
        assert!((doubts[30] - 1.0 - (30.0 / 61.0 - 0.05) / 0.03).abs() < 1e-6, "{}", doubts[30]);
        assert!((doubts[31] - 1.0 - 0.95 / 0.03).abs() < 1e-6, "{}", doubts[31]);
    }

    #[test]
    fn a_fix_alone_is_as_good_as_its_receiver() {
        assert_eq!(doubts(&[(5, 2.0)]), [1.0]);
        assert!(doubts(&[]).is_empty());
    }
}
