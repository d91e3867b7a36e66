//! Apparent pitch of the ground relative to all other surfaces, caused by ring errors of the LiDAR.
//!
//! If elevations have the same error in all rings, the measured ground is a shallow bowl around the vehicle. The map
//! holds the ground ahead as measured from a distance, and the same place appears lower from nearby. Matched alone, the
//! ground pitches the vehicle by about a tenth of the error per metre, always in the same sense: 27 degrees in 290 m
//! for each degree of error on a real HDL-64E. Facades, cars and poles do not. But most features are ground, so its
//! pitch is a separate unknown that changes slowly along the track. Its rate of change is derived from the rings: a
//! unit whose rings agree has no bowl. Where only ground is visible, it alone determines the pitch of the vehicle.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Least vertical component of the normal of a ground surface (cosine of 37 degrees, as for one surface of the map).
const GROUND_UPWARDS: f64 = 0.8;
/// Ratio of the standard deviation of the tilt to the error of the rings: the common error of all rings is often larger
/// than the errors of single rings.
const PER_RING_ERROR: f64 = 6.0;
/// Distance traveled over which the tilt changes, m: the map ahead is renewed over it.
const RENEWED_M: f64 = 30.0;
/// Shorter displacements between two sweeps have no direction, m.
const MIN_WAY_M: f64 = 0.05;

/// Apparent pitch of the ground, rad, positive if it rises ahead, and its variance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct GroundTilt {
    pub mean: f64,
    pub variance: f64,
}

impl GroundTilt {
    /// The tilt after `way_m` more metres, for a unit with ring errors of `ring_error_rad`.
    pub fn advanced(&self, way_m: f64, ring_error_rad: f64) -> Self {
        let kept = (-way_m / RENEWED_M).exp();
        let settled = (PER_RING_ERROR * ring_error_rad).powi(2);
        Self { mean: kept * self.mean, variance: settled + kept * kept * (self.variance - settled) }
    }
}

/// The derivative of residuals with respect to the ground tilt.
pub(crate) struct GroundLever {
    /// Horizontal unit vector to the left of the motion, or zero.
    left: Vector3<f64>,
}

impl GroundLever {
    /// Lever for the displacement `way`, odom axes, m.
    pub fn for_motion(way: &Vector3<f64>) -> Self {
        let horizontal = Vector3::new(way.x, way.y, 0.0);
        let length = horizontal.norm();
        Self { left: if length > MIN_WAY_M { Vector3::z().cross(&horizontal) / length } else { Vector3::zeros() } }
    }
    /// Lever of a feature at `arm` from the LiDAR on a surface with this normal, m.
    #[inline(always)]
    pub fn at(&self, arm: &Vector3<f64>, normal: &Vector3<f64>) -> f64 {
        if normal.z.abs() > GROUND_UPWARDS { -arm.cross(normal).dot(&self.left) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lever_of_the_ground_is_the_way_ahead() {
        let lever = GroundLever::for_motion(&Vector3::new(0.0, 0.7, 0.1));
        let at = |x, y, normal: Vector3<f64>| lever.at(&Vector3::new(x, y, -1.8), &normal);
        assert!((at(3.0, 12.0, Vector3::z()) - 12.0).abs() < 1e-12);
        assert!((at(-4.0, -9.0, Vector3::z()) + 9.0).abs() < 1e-12);
        assert_eq!(at(3.0, 12.0, Vector3::x()), 0.0);
        assert_eq!(GroundLever::for_motion(&Vector3::zeros()).at(&Vector3::x(), &Vector3::z()), 0.0);
    }

    #[test]
    fn tilt_of_a_unit_without_ring_errors_does_not_change() {
        assert_eq!(GroundTilt::default().advanced(100.0, 0.0), GroundTilt::default());
    }
}
