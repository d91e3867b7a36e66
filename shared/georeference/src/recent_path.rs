//! The poses of the last seconds, for sensors that measure between sweeps.

use geometry::{Point3, Pose, Vector3, interpolate};
use serde::{Deserialize, Serialize};

/// Time for which poses are kept, ns: the sensor data of a tick arrive with its sweep, the first sweep's pose one sweep
/// later.
const KEPT_NANOS: i64 = 3_000_000_000;
/// Velocities are means over twice this time, ns: a position error of 1 cm then becomes 2 cm/s.
pub(crate) const HALF_SPAN_NANOS: i64 = 250_000_000;

/// Poses of the last seconds; stamps never decrease.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct RecentPath(Vec<TimedPose>);

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct TimedPose {
    stamp: i64,
    odom_from_body: Pose,
}

impl RecentPath {
    pub fn push(&mut self, stamp: i64, odom_from_body: Pose) {
        self.0.push(TimedPose { stamp, odom_from_body });
        let keep_from = self.0.partition_point(|pose| pose.stamp < stamp - KEPT_NANOS);
        self.0.drain(..keep_from);
    }
    pub fn first(&self) -> Option<i64> {
        self.0.first().map(|pose| pose.stamp)
    }
    pub fn last(&self) -> Option<i64> {
        self.0.last().map(|pose| pose.stamp)
    }
    /// Interpolated pose; `None` before the first and after the last pose.
    pub fn at(&self, stamp: i64) -> Option<Pose> {
        let after = self.0.partition_point(|pose| pose.stamp < stamp);
        let end = self.0.get(after)?;
        if end.stamp == stamp {
            return Some(end.odom_from_body);
        }
        let begin = self.0.get(after.checked_sub(1)?)?;
        let share = (stamp - begin.stamp) as f64 / (end.stamp - begin.stamp) as f64;
        Some(interpolate(&begin.odom_from_body, &end.odom_from_body, share))
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
