//! Errors of the elevation angles of a LiDAR's rings, estimated while it drives.
//!
//! Elevations of real units have constant errors of a tenth of a degree from ring to ring: rings that measure one patch
//! of road place it at different heights. The mean distance of a ring's features from the map, which was built from
//! other rings, determines the error of the ring.
//!
//! A common error of all rings makes the ground a shallow bowl: the map ahead was built from a distance, the map behind
//! from nearby, and both pitch the vehicle. The error is an unknown of each match; its lever is the lever of the
//! feature minus the lever of the map. A vertical curve of the road has the same effect, so the error is estimated only
//! in units whose single rings have errors; see also [`crate::self_calibration::ground_tilt`].

use crate::Feature;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Standard deviation of a ring's error before it is measured, rad: 0.2 degrees.
const INITIAL_RAD: f64 = 3.5e-3;
/// Error of a residual for the weight of a measurement, m; see [`crate::MatchSettings::residual_m`].
const RESIDUAL_M: f64 = 0.1;
/// Map points whose lever differs by less, m, were measured by the same ring from nearby: they have the same error.
const OTHER_RING_M: f64 = 2.0;
/// Ratio of the common error of all rings to the errors of single rings.
const PER_RING_ERROR: f64 = 2.0;
/// Least standard deviation of the common error, rad: 0.01 degrees. Errors of the map are correlated from sweep to
/// sweep.
const MIN_COMMON_RAD: f64 = 1.75e-4;
/// A ring is measured when its standard deviation is below this share of the initial one.
const MEASURED: f64 = 0.5;

/// Displacement of a point along a normal per radian of elevation error, m. Both vectors are in the LiDAR frame, whose
/// z axis is the rotation axis.
#[inline(always)]
pub(crate) fn lever(position: &Vector3<f32>, normal: &Vector3<f32>) -> f32 {
    let horizontal = (position.x * position.x + position.y * position.y).sqrt().max(1e-3);
    normal.z * horizontal - position.z / horizontal * (normal.x * position.x + normal.y * position.y)
}

/// Sums over a ring's features with residual r, lever l and weight w: of w l^2 and of w l r.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RingSums([f64; 2]);

impl RingSums {
    /// Adds a feature, unless the same ring built the map around it.
    #[inline(always)]
    pub fn add(&mut self, lever: f64, map_lever: f64, r: f64, weight: f64) {
        if (lever - map_lever).abs() > OTHER_RING_M {
            self.0[0] += weight * lever * lever;
            self.0[1] += weight * lever * r;
        }
    }
    pub fn merge(&mut self, part: &Self) {
        self.0[0] += part.0[0];
        self.0[1] += part.0[1];
    }
}

/// Error of the elevation of a ring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RingError {
    /// Reported minus true elevation, rad.
    pub mean: f64,
    /// Variance of the error, rad^2; [`RingError::UNKNOWN`] has the variance of a ring that was not measured.
    pub variance: f64,
}

impl RingError {
    /// The error of a ring that has not been measured.
    pub const UNKNOWN: Self = Self { mean: 0.0, variance: INITIAL_RAD * INITIAL_RAD };
    /// The error of a unit without errors.
    pub(crate) const NONE: Self = Self { mean: 0.0, variance: 0.0 };

    /// Whether the ring was measured.
    pub fn is_measured(&self) -> bool {
        self.variance < (MEASURED * INITIAL_RAD).powi(2)
    }
}

/// Errors per row of the range image, and the common error of all rings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RingErrors {
    rows: Vec<RingError>,
    common: RingError,
}

impl Default for RingErrors {
    fn default() -> Self {
        Self { rows: Vec::new(), common: RingError::UNKNOWN }
    }
}

impl RingErrors {
    /// The errors per row.
    pub fn by_row(&self) -> &[RingError] {
        &self.rows
    }
    /// Root mean square of the errors in excess of their standard deviations, rad; 0 for a unit without significant
    /// errors.
    pub fn significant_rad(&self) -> f64 {
        let measured: Vec<&RingError> = self.rows.iter().filter(|ring| ring.is_measured()).collect();
        let sum: f64 = measured.iter().map(|ring| ring.mean * ring.mean - ring.variance).sum();
        (sum / measured.len().max(1) as f64).max(0.0).sqrt()
    }
    /// Moves features to the positions they would have without the errors.
    pub fn correct(&self, features: &mut [Feature]) {
        let significant = self.significant_rad();
        if significant == 0.0 {
            return;
        }
        let common = self.common_correction(significant);
        for feature in features {
            let [x, y, z] = feature.position;
            let error = (self.correction(usize::from(feature.row), significant) + common) as f32;
            let horizontal = (x * x + y * y).sqrt().max(1e-3);
            let along = error * z / horizontal;
            feature.position = [x + along * x, y + along * y, z - error * horizontal];
        }
    }
    /// Adds the sums of a match of corrected features.
    pub fn update(&mut self, sums: &[RingSums]) {
        let significant = self.significant_rad();
        if self.rows.len() < sums.len() {
            self.rows.resize(sums.len(), RingError::UNKNOWN);
        }
        for (row, RingSums([squares, products])) in sums.iter().enumerate().filter(|(_, sums)| sums.0[0] > 0.0) {
            let measured = self.correction(row, significant) + products / squares;
            let ring = &mut self.rows[row];
            let gain = ring.variance / (ring.variance + RESIDUAL_M * RESIDUAL_M / squares);
            ring.mean += gain * (measured - ring.mean);
            ring.variance *= 1.0 - gain;
        }
    }
    /// The error of a row, reduced by the possible share of noise in it.
    fn correction(&self, row: usize, significant: f64) -> f64 {
        let signal = significant * significant;
        self.rows.get(row).map_or(0.0, |ring| ring.mean * signal / (signal + ring.variance).max(f64::MIN_POSITIVE))
    }
    /// The common error of all rings, reduced in the same manner.
    fn common_correction(&self, significant: f64) -> f64 {
        let signal = (PER_RING_ERROR * significant).powi(2);
        self.common.mean * signal / (signal + self.common.variance).max(f64::MIN_POSITIVE)
    }
    /// The common error of all rings that remains after correction. For a unit without errors it is not an unknown.
    pub fn rest(&self) -> RingError {
        let significant = self.significant_rad();
        if significant == 0.0 {
            return RingError::NONE;
        }
        RingError { mean: self.common.mean - self.common_correction(significant), ..self.common }
    }
    /// Adds the common error that remains after a match of corrected features.
    pub fn update_common(&mut self, rest: &RingError) {
        let significant = self.significant_rad();
        if significant > 0.0 {
            let mean = self.common_correction(significant) + rest.mean;
            self.common = RingError { mean, variance: rest.variance.max(MIN_COMMON_RAD * MIN_COMMON_RAD) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feature(row: u16) -> Feature {
        let position = [8.0, 6.0, -1.8];
        let normal = [0.0, 0.0, 1.0];
        let lever = lever(&position.into(), &normal.into());
        Feature {
            position,
            normal,
            share: 0.0,
            planarity: 1.0,
            roughness_m: 0.01,
            is_rough: false,
            lever,
            row,
            point_idx: 0,
        }
    }

    /// Ring errors after `n` matches of features of two rings with a map at the true height.
    fn after(n: usize, errors: [f64; 2]) -> RingErrors {
        let mut found = RingErrors::default();
        for _ in 0..n {
            let sums = [0, 1].map(|row| {
                let mut features = [feature(row)];
                features[0].position[2] += (errors[usize::from(row)] * 10.0) as f32;
                found.correct(&mut features);
                let r = f64::from(features[0].position[2]) + 1.8;
                let mut sums = RingSums::default();
                (0..50).for_each(|_| sums.add(f64::from(features[0].lever), 20.0, r, 1.0));
                sums
            });
            found.update(&sums);
        }
        found
    }

    #[test]
    fn errors_of_two_rings_are_found_and_corrected() {
        let errors = [2e-3, -3e-3];
        let found = after(60, errors);
        for (ring, error) in found.rows.iter().zip(errors) {
            assert!((ring.mean - error).abs() < 2e-4, "{ring:?} for {error}");
        }
        assert!((found.significant_rad() - 2.5e-3).abs() < 2e-4, "{}", found.significant_rad());
        let mut features = [feature(1)];
        found.correct(&mut features);
        assert!((features[0].position[2] + 1.8 - 0.03).abs() < 2e-3, "{features:?}");
    }

    #[test]
    fn rings_without_errors_are_not_corrected() {
        let found = after(60, [1e-5, -1e-5]);
        assert_eq!(found.significant_rad(), 0.0);
        let mut features = [feature(0)];
        found.correct(&mut features);
        assert_eq!(features, [feature(0)]);
    }

    #[test]
    fn points_seen_by_the_same_ring_from_nearby_tell_nothing() {
        let mut sums = RingSums::default();
        sums.add(10.0, 11.0, 0.05, 1.0);
        assert_eq!(sums, RingSums::default());
    }
}
