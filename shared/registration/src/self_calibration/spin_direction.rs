//! Spin direction of a sensor whose recording has no point times.
//!
//! Treated as rigid, the sweep of a spinning sensor is sheared: at 10 m/s its left and right side are half a metre
//! apart along the track. Static objects then move relative to the map while they pass from ahead to the side, forwards
//! on one side and backwards on the other, and the match rotates the vehicle: by 2.5 degrees in 290 m on a real
//! HDL-64E. Each match therefore also estimates the share of the motion during a revolution, from rear to rear, by
//! which the points are displaced: 1 for a sensor that spins clockwise, -1 counterclockwise, 0 for sweeps that are
//! deskewed.

use crate::sweep::SpinDirection;
use geometry::Pose;
use lidar::fast_atan2;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Standard deviation of the share before it is measured: any of -1, 0, 1 is possible.
const INITIAL_DEVIATION: f64 = 1.0;
/// Least standard deviation: errors of the map are correlated from sweep to sweep.
const MIN_DEVIATION: f64 = 0.03;
/// Largest absolute share of deskewed sweeps, which have 0.02 at most. A spinning sensor has 0.3 to 0.6 instead of 1,
/// because the map absorbs half of the displacement.
const MIN_SHARE: f64 = 0.2;
/// The direction is known if the share exceeds `MIN_SHARE` by this number of standard deviations.
const CERTAIN: f64 = 2.0;

/// Share of the motion during a revolution by which the points of untimed sweeps are displaced, positive if clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TurnShare {
    pub mean: f64,
    pub variance: f64,
}

impl Default for TurnShare {
    fn default() -> Self {
        Self { mean: 0.0, variance: INITIAL_DEVIATION * INITIAL_DEVIATION }
    }
}

impl TurnShare {
    /// The share estimated by a match.
    pub fn measured(mean: f64, variance: f64) -> Self {
        Self { mean, variance: variance.max(MIN_DEVIATION * MIN_DEVIATION) }
    }
    /// The direction, once it is certain.
    pub fn direction(&self) -> Option<SpinDirection> {
        let is_certain = self.mean.abs() > MIN_SHARE + CERTAIN * self.variance.sqrt();
        let direction = if self.mean > 0.0 { SpinDirection::Clockwise } else { SpinDirection::Counterclockwise };
        is_certain.then_some(direction)
    }
}

/// The derivative of a point's height above its surface with respect to the share, for a sensor that spins clockwise
/// from rear to rear.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TurnLever {
    /// Motion during a revolution: displacement of the LiDAR, m, and rotation vector, both in odom axes.
    motion: Option<(Vector3<f64>, Vector3<f64>)>,
}

impl TurnLever {
    /// Lever for sweeps with point times, and for runs that do not determine the direction.
    pub const NONE: Self = Self { motion: None };

    /// Lever for a motion between poses `seconds` apart and a revolution in `turn_s`.
    pub fn between(from: &Pose, to: &Pose, seconds: f64, turn_s: f64) -> Self {
        let share = turn_s / seconds;
        let translation = (to.translation.vector - from.translation.vector) * share;
        let rotation = (to.rotation * from.rotation.inverse()).scaled_axis() * share;
        Self { motion: Some((translation, rotation)) }
    }
    /// Lever of a point in the LiDAR's axes, at `arm` from the LiDAR in odom axes, on a surface with this normal, m.
    #[inline(always)]
    pub fn at(&self, position: &[f32; 3], arm: &Vector3<f64>, normal: &Vector3<f64>) -> f64 {
        let Some((translation, rotation)) = &self.motion else { return 0.0 };
        let share = -f64::from(fast_atan2(position[1], position[0]) / std::f32::consts::TAU);
        share * normal.dot(&(translation + rotation.cross(arm)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, Translation3, UnitQuaternion};

    #[test]
    fn points_on_the_left_are_taken_early_by_a_sensor_that_turns_clockwise() {
        let to = Isometry3::from_parts(Translation3::new(2.0, 0.0, 0.0), UnitQuaternion::identity());
        let lever = TurnLever::between(&Pose::identity(), &to, 0.2, 0.1);
        let ahead = |position: [f32; 3]| lever.at(&position, &Vector3::from(position).cast(), &Vector3::x());
        assert!((ahead([0.0, 5.0, 0.0]) + 0.25).abs() < 1e-4);
        assert!((ahead([0.0, -5.0, 0.0]) - 0.25).abs() < 1e-4);
        assert!(ahead([7.0, 0.0, 0.0]).abs() < 1e-4);
        assert_eq!(TurnLever::NONE.at(&[0.0, 5.0, 0.0], &Vector3::y(), &Vector3::x()), 0.0);
    }

    #[test]
    fn direction_is_known_once_the_share_is_certain() {
        assert_eq!(TurnShare::default().direction(), None);
        assert_eq!(TurnShare { mean: 0.5, variance: 0.04 }.direction(), None);
        assert_eq!(TurnShare { mean: 0.5, variance: 0.01 }.direction(), Some(SpinDirection::Clockwise));
        assert_eq!(TurnShare { mean: -0.5, variance: 0.01 }.direction(), Some(SpinDirection::Counterclockwise));
        assert_eq!(TurnShare { mean: 0.15, variance: 0.0 }.direction(), None);
    }
}
