//! Covariance of the odometry between two consecutive submaps.

use geometry::Pose;
use nalgebra::{Matrix6, Vector6};
use registration::Registered;
use serde::{Deserialize, Serialize};

/// Variances that grow with the path length, m^2 and rad^2 per m: 2 cm over 20 m, and 1.6 mrad (0.09 degrees) with the
/// LiDAR alone, as on simulated and real streets (0.2 degrees over 100 m, see `lab/peers/README.md`).
const TRANSLATION_VARIANCE: f64 = 2e-5;
const ROTATION_VARIANCE: f64 = 1.3e-7;
/// Rotation variance with gyroscopes, rad^2 per m. 0.3 to 0.4 mrad are measured over the 18 m from submap to submap of
/// drives 11 and 12 (`lab/notebook/georeferencing.md`); this value is 0.6 mrad.
const ROTATION_VARIANCE_WITH_GYROSCOPES: f64 = 2e-8;
/// Least variances between two submaps: 5 mm and 0.2 mrad.
const MIN_VARIANCES: [f64; 2] = [2.5e-5, 4e-8];
/// Error of a sweep along a degenerate direction: this share of its path, and at least this, m.
const DEGENERATE_SHARE: f64 = 0.1;
const DEGENERATE_M: f64 = 0.02;
/// Error of a sweep without a match: this share of its path plus this, m, and this rotation, rad.
const BRIDGED_SHARE: f64 = 0.15;
const BRIDGED_M: f64 = 0.05;
const BRIDGED_RAD: f64 = 0.005;
/// Rotations are converted to the displacement at this distance, m, as in `registration`.
const LEVER_M: f64 = 10.0;

/// Uncertainty accumulated since the start of the submap.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Drift {
    /// Translation and rotation, m^2 and rad^2.
    variances: [f64; 2],
    /// Sum of standard deviations along degenerate directions, odom axes. Each sweep continues the motion of the previous
    /// one, so the errors of degenerate directions add up linearly.
    degenerate: Matrix6<f64>,
    /// Path that was matched without gyroscopes, m.
    bent_m: f64,
}

impl Drift {
    pub fn add(&mut self, registered: &Registered, path_m: f64) {
        let has_gyroscopes = registered.predicted_by.inertial;
        self.bent_m += if has_gyroscopes { 0.0 } else { path_m };
        self.variances[0] += TRANSLATION_VARIANCE * path_m;
        self.variances[1] +=
            if has_gyroscopes { ROTATION_VARIANCE_WITH_GYROSCOPES } else { ROTATION_VARIANCE } * path_m;
        let Some(matched) = &registered.matched else {
            let m = BRIDGED_M + BRIDGED_SHARE * path_m;
            let rad = BRIDGED_RAD;
            self.degenerate += Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
            return;
        };
        if matched.n_degenerate_directions == 0 {
            return;
        }
        let per_lever = Vector6::new(1.0, 1.0, 1.0, 1.0 / LEVER_M, 1.0 / LEVER_M, 1.0 / LEVER_M);
        let scale = Matrix6::from_diagonal(&per_lever);
        let eigen = (scale * matched.information * scale).symmetric_eigen();
        let mut by_strength: Vec<usize> = (0..6).collect();
        by_strength.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        for &k in by_strength.iter().take(matched.n_degenerate_directions as usize) {
            let direction = eigen.eigenvectors.column(k).component_mul(&per_lever);
            self.degenerate += direction * direction.transpose() * (DEGENERATE_M + DEGENERATE_SHARE * path_m);
        }
    }

    /// Path whose pitch may have a systematic error, m.
    pub const fn bent_m(&self) -> f64 {
        self.bent_m
    }

    /// Inverse covariance of the next submap's pose relative to the submap that starts at `odom_from_submap`.
    pub fn information(&self, odom_from_submap: &Pose) -> Matrix6<f64> {
        let [m, rad] = [0, 1].map(|k| MIN_VARIANCES[k] + self.variances[k]);
        let mut axes = Matrix6::zeros();
        let rotation = odom_from_submap.rotation.inverse().to_rotation_matrix();
        axes.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
        axes.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation.matrix());
        let degenerate = axes * self.degenerate * self.degenerate * axes.transpose();
        let covariance = Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad)) + degenerate;
        // The covariance is at least its diagonal part, so it is invertible.
        let information = covariance.try_inverse().unwrap_or_else(Matrix6::zeros);
        (information + information.transpose()) * 0.5
    }
}
