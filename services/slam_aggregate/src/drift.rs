//! How well the odometry knows the way from one submap to the next.

use geometry::Pose;
use nalgebra::{Matrix6, Vector6};
use registration::Registered;
use serde::{Deserialize, Serialize};

/// Variances that grow with the way, m^2 and rad^2 per m: 2 cm over 20 m, and 1.6 mrad (0.09 degrees) by the lidar alone, as on
/// simulated and real streets (`docs/odometry.md`: 0.2 degrees over 100 m).
const MOVES: f64 = 2e-5;
const TURNS: f64 = 1.3e-7;
/// With gyroscopes 0.3 to 0.4 mrad are measured over the 18 m from submap to submap of drives 11 and 12
/// (`docs/georeference.md`); this is 0.6.
const TURNS_FELT: f64 = 2e-8;
/// Those of any two submaps: 5 mm and 0.2 mrad.
const LEAST: [f64; 2] = [2.5e-5, 4e-8];
/// What a sweep may be off in a direction that its scene does not determine: this share of its way, and at least this, m.
const WEAK_SHARE: f64 = 0.1;
const WEAK_M: f64 = 0.02;
/// What a sweep without a match may be off: this share of its way and this, m, and turns by this, rad.
const BRIDGED_SHARE: f64 = 0.15;
const BRIDGED_M: f64 = 0.05;
const BRIDGED_RAD: f64 = 0.005;
/// Rotations weigh as the displacement that they cause at this distance, m, as in `registration`.
const LEVER_M: f64 = 10.0;

/// What has come together since the submap began; part of the stage's state.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Drift {
    /// m^2 and rad^2.
    grown: [f64; 2],
    /// Sum of standard deviations along directions, odom axes: one sweep goes on as the one before, so errors of weak
    /// directions add up as they are.
    weak: Matrix6<f64>,
}

impl Drift {
    pub fn add(&mut self, registered: &Registered, way_m: f64) {
        self.grown[0] += MOVES * way_m;
        self.grown[1] += if registered.lean.inertial { TURNS_FELT } else { TURNS } * way_m;
        let Some(matched) = &registered.matched else {
            let (m, rad) = (BRIDGED_M + BRIDGED_SHARE * way_m, BRIDGED_RAD);
            self.weak += Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
            return;
        };
        if matched.n_weak_directions == 0 {
            return;
        }
        let per_lever = Vector6::new(1.0, 1.0, 1.0, 1.0 / LEVER_M, 1.0 / LEVER_M, 1.0 / LEVER_M);
        let scale = Matrix6::from_diagonal(&per_lever);
        let eigen = (scale * matched.information * scale).symmetric_eigen();
        let mut by_strength: Vec<usize> = (0..6).collect();
        by_strength.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        for &k in by_strength.iter().take(matched.n_weak_directions as usize) {
            let direction = eigen.eigenvectors.column(k).component_mul(&per_lever);
            self.weak += direction * direction.transpose() * (WEAK_M + WEAK_SHARE * way_m);
        }
    }

    /// Inverse covariance of the next submap's pose in the one that begins at `odom_from_submap`.
    pub fn information(&self, odom_from_submap: &Pose) -> Matrix6<f64> {
        let [m, rad] = [0, 1].map(|k| LEAST[k] + self.grown[k]);
        let mut axes = Matrix6::zeros();
        let turn = odom_from_submap.rotation.inverse().to_rotation_matrix();
        axes.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        axes.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
        let weak = axes * self.weak * self.weak * axes.transpose();
        let covariance = Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad)) + weak;
        // It is at least the diagonal, so it can be inverted.
        let information = covariance.try_inverse().unwrap_or_else(Matrix6::zeros);
        (information + information.transpose()) * 0.5
    }
}
