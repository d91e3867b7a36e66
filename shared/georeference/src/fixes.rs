//! Converts fixes of a GNSS receiver to antenna positions and velocities in submaps.

use crate::antenna_track::AntennaTrack;
use crate::georeferencer::NumberedSubmap;
use crate::recent_path::RecentPath;
use crate::{AntennaPosition, HorizontalVelocity};
use geometry::{Geodetic, LocalFrame, Point3, Pose};
use messages::GnssRow;
use nalgebra::Vector2;
use registration::GroundVelocity;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Fixes within this time count as one measurement, s: the time in which the vehicle passes a house and its
/// reflections.
const ERROR_CORRELATION_S: f64 = 8.0;
/// Below this speed, m/s, the errors last longer, because the surroundings of the antenna change more slowly; the
/// factor is limited.
const PASSING_MPS: f64 = 3.0;
const MAX_SLOWNESS: f64 = 10.0;
/// Fixes closer in time are skipped, ns: their errors are the same.
const MIN_PAUSE_NANOS: i64 = 450_000_000;
/// Ratio of height errors to horizontal errors if the receiver states no vertical dilution: all satellites are above the antenna.
const VERTICAL_FACTOR: f64 = 1.5;
/// Fixes this close to the result are never outliers, m: code positions wander by this much even without faults.
const CODE_TOLERANCE_M: f64 = 0.6;
const CARRIER_TOLERANCE_M: f64 = 0.05;
/// Largest number of fixes that wait for the odometry: three minutes at 20 Hz. Without sweeps there is no odometry.
const MAX_PENDING: usize = 1 << 12;
/// Dilution of precision if the receiver reports none.
const DEFAULT_HDOP: f64 = 2.0;
/// Velocities below this speed have no reliable direction, m/s.
const MIN_COURSE_MPS: f64 = 1.0;

/// Collects fixes.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Fixes {
    /// Fixes later than the last pose of the odometry.
    pending: VecDeque<Fix>,
    /// Origin of the world.
    origin: Option<Geodetic>,
    used: Vec<UsedFix>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Fix {
    stamp: i64,
    place: Geodetic,
    hdop: f64,
    vdop: f64,
    stated_m: Option<[f64; 2]>,
    receiver: ReceiverClass,
    velocity: Option<Doppler>,
}

/// Horizontal velocity that the receiver measured from Doppler shifts.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Doppler {
    /// Towards east and north, m/s.
    pub east_north: [f64; 2],
    /// Standard deviation of each, m/s.
    pub sigma_mps: f64,
}

/// A fix within the time of the trajectory.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct UsedFix {
    pub stamp: i64,
    pub hdop: f64,
    /// Vertical dilution of precision.
    pub vdop: f64,
    /// Standard deviations that the receiver states, along one horizontal axis and in height, m.
    pub stated_m: Option<[f64; 2]>,
    pub receiver: ReceiverClass,
    /// Number of the submap, and the antenna path around the fix from the odometry.
    pub submap: usize,
    pub antenna: AntennaTrack,
    /// Position from the receiver.
    pub p_in_world: Point3<f64>,
    pub velocity: Option<Doppler>,
    /// Time since the previous fix, s; at most [`ERROR_CORRELATION_S`].
    pub pause_s: f64,
}

/// Kind of position solution, from GGA's quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ReceiverClass {
    Code,
    CorrectedCode,
    CarrierFixed,
    CarrierFloat,
}

impl ReceiverClass {
    const fn from_quality(quality: u32) -> Option<Self> {
        match quality {
            0 => None,
            2 => Some(Self::CorrectedCode),
            4 => Some(Self::CarrierFixed),
            5 => Some(Self::CarrierFloat),
            _ => Some(Self::Code),
        }
    }
    /// Whether the position is from carrier phases: errors of consecutive fixes are then independent.
    pub const fn is_by_carrier(self) -> bool {
        matches!(self, Self::CarrierFixed | Self::CarrierFloat)
    }
    /// Scatter of fixes around their common error, along one horizontal axis at a dilution of 1, m.
    const fn scatter_m(self) -> f64 {
        match self {
            Self::Code => 0.6,
            Self::CorrectedCode => 0.3,
            Self::CarrierFixed => 0.02,
            Self::CarrierFloat => 0.15,
        }
    }
    /// Common error of all fixes of a drive, along one horizontal axis and in height, m: orbits, clocks, atmosphere. It
    /// is unobservable in a drive. Corrections leave a tenth of a metre for each satellite; the height has no
    /// satellites from below.
    const fn common_m(self) -> [f64; 2] {
        match self {
            Self::Code => [1.0, 2.0],
            Self::CorrectedCode => [0.2, 0.6],
            Self::CarrierFixed => [0.01, 0.02],
            Self::CarrierFloat => [0.1, 0.2],
        }
    }
}

impl Fix {
    /// Converts a row; `None` if it has no valid position.
    pub fn new(row: &GnssRow) -> Option<Self> {
        let place = Geodetic::new(row.latitude_deg, row.longitude_deg, row.altitude_m)?;
        let receiver = ReceiverClass::from_quality(row.quality)?;
        let reported_hdop = (row.hdop > 0.0).then_some(f64::from(row.hdop));
        let hdop = reported_hdop.unwrap_or(DEFAULT_HDOP).max(0.5);
        let reported_vdop = (row.vdop > 0.0).then_some(f64::from(row.vdop));
        let vdop = reported_vdop.unwrap_or(VERTICAL_FACTOR * hdop).max(0.5);
        let stated_m = [row.deviation_across_m, row.deviation_up_m].map(f64::from);
        let stated_m = stated_m.iter().all(|m| *m > 0.0).then_some(stated_m);
        let velocity = Doppler::new(row, reported_hdop);
        Some(Self { stamp: row.stamp, place, hdop, vdop, stated_m, receiver, velocity })
    }
}

impl Doppler {
    fn new(row: &GnssRow, hdop: Option<f64>) -> Option<Self> {
        let course_deg = (row.course_deg >= 0.0).then_some(row.course_deg);
        let is_fast = row.speed_mps >= MIN_COURSE_MPS && course_deg.is_some();
        let velocity = GroundVelocity::new(geometry::Stamp(row.stamp), row.speed_mps, course_deg, hdop);
        let velocity = velocity.filter(|_| is_fast)?;
        Some(Self { east_north: velocity.east_north, sigma_mps: velocity.sigma })
    }
    pub fn vector(&self) -> Vector2<f64> {
        self.east_north.into()
    }
}

impl UsedFix {
    /// The position as a measurement of its submap, for a receiver clock that is `late_s` late.
    pub fn position(&self, late_s: f64, odom_from_submap: &Pose) -> AntennaPosition {
        let scatter_m = self.receiver.scatter_m();
        // Receivers do not know of reflections, so a smaller deviation than the class has is not trusted.
        let [across_m, up_m] = self.stated_m.unwrap_or_default();
        let sigma = (scatter_m * self.hdop).max(across_m);
        let sigma_up = (scatter_m * self.vdop).max(up_m);
        AntennaPosition {
            submap: self.submap,
            p_in_submap: odom_from_submap.inverse() * self.antenna.at(-late_s),
            p_in_world: self.p_in_world,
            sigma_m: [sigma, sigma, sigma_up],
            sigma_above_m: sigma_up,
            share: self.passing_s(late_s) / ERROR_CORRELATION_S,
            tolerance_m: self.tolerance_m(),
        }
    }
    /// Time since the previous fix, s, shorter while the vehicle is slow: the surroundings of the antenna change less.
    pub fn passing_s(&self, late_s: f64) -> f64 {
        let speed = self.antenna.velocity(-late_s).norm();
        self.pause_s * (speed / PASSING_MPS).clamp(1.0 / MAX_SLOWNESS, 1.0)
    }
    /// Error that all fixes of the drive may share, along one horizontal axis and in height, m. A stated deviation is mostly such an
    /// error: it does not average out.
    pub fn common_m(&self) -> [f64; 2] {
        let [across_m, up_m] = self.receiver.common_m();
        let [stated_across_m, stated_up_m] = self.stated_m.unwrap_or_default();
        [across_m.max(stated_across_m), up_m.max(stated_up_m)]
    }
    /// Fixes this close to the result are never outliers, m.
    pub fn tolerance_m(&self) -> f64 {
        self.hdop * if self.receiver.is_by_carrier() { CARRIER_TOLERANCE_M } else { CODE_TOLERANCE_M }
    }
    /// The velocity as a measurement of its submap.
    pub fn horizontal_velocity(&self, late_s: f64, odom_from_submap: &Pose) -> Option<HorizontalVelocity> {
        let v_in_submap = odom_from_submap.rotation.inverse() * self.antenna.velocity(-late_s);
        let Doppler { east_north, sigma_mps } = self.velocity?;
        Some(HorizontalVelocity { submap: self.submap, v_in_submap, v_in_world: east_north, sigma_mps })
    }
}

impl Fixes {
    /// `origin` is the origin of the drive's world, if its recording has one; otherwise the first fix becomes the
    /// origin.
    pub fn with_origin(origin: Option<Geodetic>) -> Self {
        Self { origin, ..Self::default() }
    }
    pub const fn origin(&self) -> Option<Geodetic> {
        self.origin
    }
    /// Adds a fix. While the odometry does not advance, the oldest fixes are dropped.
    pub fn push(&mut self, fix: Fix) {
        self.pending.push_back(fix);
        let n_over = self.pending.len().saturating_sub(MAX_PENDING);
        self.pending.drain(..n_over);
    }
    /// Uses the fixes with odometry around their times; at the end of the drive, all up to the last pose. `submap_at`
    /// returns the submap at a stamp.
    pub fn update(
        &mut self,
        path: &RecentPath,
        antenna_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<NumberedSubmap>,
        is_end: bool,
    ) {
        let Some(last) = path.last() else { return };
        let end = if is_end { last } else { last - AntennaTrack::HALF_SPAN_NANOS };
        let n_ready = self.pending.iter().take_while(|fix| fix.stamp <= end).count();
        for Fix { stamp, place, hdop, vdop, stated_m, receiver, velocity } in self.pending.drain(..n_ready) {
            let pause = self.used.last().map_or(i64::MAX, |last| stamp.saturating_sub(last.stamp));
            let Some(antenna) = AntennaTrack::new(path, stamp, antenna_in_body) else { continue };
            let Some(NumberedSubmap { number: submap, .. }) = submap_at(stamp) else { continue };
            if pause < MIN_PAUSE_NANOS {
                continue;
            }
            let origin = *self.origin.get_or_insert(place);
            let p_in_world = LocalFrame::new(origin).world_from_geodetic(&place);
            let pause_s = (pause as f64 * 1e-9).min(ERROR_CORRELATION_S);
            let of_drive =
                UsedFix { stamp, hdop, vdop, stated_m, receiver, submap, antenna, p_in_world, velocity, pause_s };
            self.used.push(of_drive);
        }
    }
    pub fn used(&self) -> &[UsedFix] {
        &self.used
    }
}

#[cfg(test)]
impl UsedFix {
    /// A fix at a given second and dilution, for tests of the errors.
    pub fn for_test(second: i64, hdop: f64, by_carrier: bool) -> Self {
        let receiver = if by_carrier { ReceiverClass::CarrierFixed } else { ReceiverClass::CorrectedCode };
        let antenna = AntennaTrack::default();
        let p_in_world = Point3::origin();
        let velocity = None;
        let pause_s = 1.0;
        let vdop = VERTICAL_FACTOR * hdop;
        let stamp = second * 1_000_000_000;
        let stated_m = None;
        Self { stamp, hdop, vdop, stated_m, receiver, submap: 0, antenna, p_in_world, velocity, pause_s }
    }
}
