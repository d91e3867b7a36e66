//! The poses of the last seconds, for sensors that measure between sweeps.

use geometry::{Point3, Pose, Vector3, interpolate};
use serde::{Deserialize, Serialize};

/// Time for which poses are kept, ns: the sensor data of a tick arrive with its sweep, the first sweep's pose one sweep
/// later.
const KEPT_NANOS: i64 = 3_000_000_000;
/// Velocities are means over twice this time, ns: a position error of 1 cm then becomes 2 cm/s.
pub(crate) const HALF_SPAN_NANOS: i64 = 250_000_000;

/// `odom_from_body` by stamp; stamps never decrease.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct RecentPath(Vec<(i64, Pose)>);

impl RecentPath {
    pub fn push(&mut self, stamp: i64, odom_from_body: Pose) {
        self.0.push((stamp, odom_from_body));
        let keep_from = self.0.partition_point(|(at, _)| *at < stamp - KEPT_NANOS);
        self.0.drain(..keep_from);
    }
    pub fn first(&self) -> Option<i64> {
        self.0.first().map(|(stamp, _)| *stamp)
    }
    pub fn last(&self) -> Option<i64> {
        self.0.last().map(|(stamp, _)| *stamp)
    }
    /// Interpolated pose; `None` before the first and after the last pose.
    pub fn at(&self, stamp: i64) -> Option<Pose> {
        let after = self.0.partition_point(|(at, _)| *at < stamp);
        let (end, b) = self.0.get(after)?;
        if *end == stamp {
            return Some(*b);
        }
        let (begin, a) = self.0.get(after.checked_sub(1)?)?;
        Some(interpolate(a, b, (stamp - begin) as f64 / (end - begin) as f64))
    }
    /// Mean velocity of a point of the body around a stamp, odom axes, m/s. At either end of the path the mean is over
    /// the available part.
    pub fn velocity(&self, stamp: i64, p_in_body: &Point3<f64>) -> Option<Vector3<f64>> {
        let begin = (stamp - HALF_SPAN_NANOS).max(self.first()?);
        let end = (stamp + HALF_SPAN_NANOS).min(self.last()?);
        let displacement = (self.at(end)? * p_in_body) - (self.at(begin)? * p_in_body);
        (end > begin).then(|| displacement / ((end - begin) as f64 * 1e-9))
    }
}
