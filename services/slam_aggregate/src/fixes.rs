//! From fixes of a receiver to positions in submaps.

use crate::recent_path::RecentPath;
use geometry::{Geodetic, LocalFrame, Point3, Pose};
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
/// Dilution where the receiver does not tell.
const USUAL_HDOP: f64 = 2.0;

/// Collects fixes; part of the stage's state.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Fixes {
    /// Those whose time the odometry has not reached.
    waiting: Vec<Fix>,
    /// Zero of the world.
    origin: Option<Geodetic>,
    /// One for each position.
    settled: Vec<Settled>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Fix {
    stamp: i64,
    place: Geodetic,
    hdop: f64,
    /// At a dilution of 1.
    sigma_m: f64,
    by_carrier: bool,
}

/// What is known of a position besides.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Settled {
    pub stamp: i64,
    pub hdop: f64,
    /// By carrier phases: each fix stands for itself.
    pub by_carrier: bool,
    /// Where the odometry saw the antenna.
    pub antenna_in_odom: Point3<f64>,
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
        let by_carrier = matches!(row.quality, 4 | 5);
        self.waiting.push(Fix { stamp: row.stamp, place, hdop: hdop.max(0.5), sigma_m, by_carrier });
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
        let n_passed = self.waiting.iter().take_while(|fix| fix.stamp <= end).count();
        for Fix { stamp, place, hdop, sigma_m, by_carrier } in self.waiting.drain(..n_passed) {
            let pause = self.settled.last().map_or(i64::MAX, |last| stamp.saturating_sub(last.stamp));
            let (Some(pose), Some((submap, odom_from_submap))) = (path.at(stamp), submap_at(stamp)) else { continue };
            if pause < LEAST_PAUSE_NANOS {
                continue;
            }
            let origin = *self.origin.get_or_insert(place);
            let antenna_in_odom = pose * antenna_in_body;
            let sigma = sigma_m * hdop;
            positions.push(Position {
                submap,
                p_in_submap: odom_from_submap.inverse() * antenna_in_odom,
                p_in_world: LocalFrame::new(origin).world_from_geodetic(&place),
                sigma_m: [sigma, sigma, VERTICAL * sigma],
                sigma_above_m: ABOVE * VERTICAL * sigma,
                share: (pause as f64 * 1e-9 / ERRORS_LAST_S).min(1.0),
            });
            self.settled.push(Settled { stamp, hdop, by_carrier, antenna_in_odom });
        }
    }
    /// One for each position.
    pub fn settled(&self) -> &[Settled] {
        &self.settled
    }
    /// The positions as the odometry and as the receiver saw them.
    pub fn sightings(&self, positions: &[Position]) -> Vec<Sighting> {
        let pairs = self.settled.iter().zip(positions);
        pairs
            .map(|(fix, position)| Sighting { p_in_odom: fix.antenna_in_odom, p_in_world: position.p_in_world })
            .collect()
    }
}
