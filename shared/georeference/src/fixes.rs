//! From fixes of a GNSS receiver to antenna positions in submaps.

use crate::recent_path::RecentPath;
use crate::{AntennaPosition, PointPair};
use geometry::{Geodetic, LocalFrame, Point3, Pose};
use messages::GnssRow;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Fixes within this time count as one measurement, s: the time in which the vehicle passes a house and its reflections.
const ERROR_CORRELATION_S: f64 = 8.0;
/// Fixes closer in time are left out, ns: their errors are the same.
const MIN_PAUSE_NANOS: i64 = 450_000_000;
/// Errors of heights over those of horizontal positions: all satellites are above.
const VERTICAL_FACTOR: f64 = 1.8;
/// Errors of heights above the true one over those below. Reflected signals arrive late, never early, and mostly come from
/// low satellites.
const ABOVE_FACTOR: f64 = 6.0;
/// Fixes that wait for the odometry: three minutes at 20 Hz. Without sweeps there is no odometry.
const MAX_PENDING: usize = 1 << 12;
/// Dilution of precision where the receiver reports none.
const DEFAULT_HDOP: f64 = 2.0;

/// Collects fixes.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Fixes {
    /// Fixes later than the odometry.
    pending: VecDeque<Fix>,
    /// Origin of the world.
    origin: Option<Geodetic>,
    /// One for each position.
    used: Vec<UsedFix>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Fix {
    stamp: i64,
    place: Geodetic,
    hdop: f64,
    /// At a dilution of 1.
    sigma_m: f64,
    by_carrier: bool,
}

/// The fix behind an [`AntennaPosition`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct UsedFix {
    pub stamp: i64,
    pub hdop: f64,
    /// By carrier phases: errors of consecutive fixes are independent.
    pub by_carrier: bool,
    /// Position of the antenna by the odometry.
    pub antenna_in_odom: Point3<f64>,
}

/// Scatter of fixes around their common error, along one horizontal axis at a dilution of 1, m, by GGA's quality: code,
/// code with corrections, carrier phases fixed and float. It decides which fixes are consistent. The common error (orbits,
/// atmosphere: 1 to 2 m with code alone) is left out, because a drive cannot observe it.
const fn sigma_m(quality: u32) -> Option<f64> {
    match quality {
        0 => None,
        2 => Some(0.2),
        4 => Some(0.02),
        5 => Some(0.15),
        _ => Some(0.6),
    }
}

impl Fix {
    /// `None` if the row has no valid position.
    pub fn new(row: &GnssRow) -> Option<Self> {
        let place = Geodetic::new(row.latitude_deg, row.longitude_deg, row.altitude_m)?;
        let sigma_m = sigma_m(row.quality)?;
        let hdop = if row.hdop > 0.0 { f64::from(row.hdop) } else { DEFAULT_HDOP };
        let by_carrier = matches!(row.quality, 4 | 5);
        Some(Self { stamp: row.stamp, place, hdop: hdop.max(0.5), sigma_m, by_carrier })
    }
}

impl Fixes {
    /// `origin` of the drive's world, if its recording has one; otherwise the first fix becomes the origin.
    pub fn with_origin(origin: Option<Geodetic>) -> Self {
        Self { origin, ..Self::default() }
    }
    pub const fn origin(&self) -> Option<Geodetic> {
        self.origin
    }
    /// Adds a fix. While the odometry does not advance, the oldest ones are dropped.
    pub fn push(&mut self, fix: Fix) {
        self.pending.push_back(fix);
        let n_over = self.pending.len().saturating_sub(MAX_PENDING);
        self.pending.drain(..n_over);
    }
    /// Turns the fixes up to the last pose into positions. `submap_at` returns number and `odom_from_submap` of the submap
    /// at a stamp.
    pub fn update(
        &mut self,
        path: &RecentPath,
        antenna_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<(usize, Pose)>,
        positions: &mut Vec<AntennaPosition>,
    ) {
        let Some(end) = path.last() else { return };
        let n_ready = self.pending.iter().take_while(|fix| fix.stamp <= end).count();
        for Fix { stamp, place, hdop, sigma_m, by_carrier } in self.pending.drain(..n_ready) {
            let pause = self.used.last().map_or(i64::MAX, |last| stamp.saturating_sub(last.stamp));
            let (Some(pose), Some((submap, odom_from_submap))) = (path.at(stamp), submap_at(stamp)) else { continue };
            if pause < MIN_PAUSE_NANOS {
                continue;
            }
            let origin = *self.origin.get_or_insert(place);
            let antenna_in_odom = pose * antenna_in_body;
            let sigma = sigma_m * hdop;
            positions.push(AntennaPosition {
                submap,
                p_in_submap: odom_from_submap.inverse() * antenna_in_odom,
                p_in_world: LocalFrame::new(origin).world_from_geodetic(&place),
                sigma_m: [sigma, sigma, VERTICAL_FACTOR * sigma],
                sigma_above_m: ABOVE_FACTOR * VERTICAL_FACTOR * sigma,
                share: (pause as f64 * 1e-9 / ERROR_CORRELATION_S).min(1.0),
            });
            self.used.push(UsedFix { stamp, hdop, by_carrier, antenna_in_odom });
        }
    }
    /// One for each position.
    pub fn used(&self) -> &[UsedFix] {
        &self.used
    }
    /// The positions by the odometry and by the receiver.
    pub fn point_pairs(&self, positions: &[AntennaPosition]) -> Vec<PointPair> {
        let pairs = self.used.iter().zip(positions);
        pairs
            .map(|(fix, position)| PointPair { p_in_odom: fix.antenna_in_odom, p_in_world: position.p_in_world })
            .collect()
    }
}
