//! A well-matched sweep.

use geometry::Stamp;
use nalgebra::Matrix6;
use registration::{Matched, PredictionSources, Registered, SweepMotion};

/// A registered sweep with `n` features, all of them matched.
pub fn registered(stamp: i64, duration_nanos: u32, motion: SweepMotion, n: usize, receiver: bool) -> Registered {
    let matched = Matched {
        motion,
        n_features: n,
        n_matches: n,
        rms_m: 0.02,
        cost: 0.1,
        least_influence: 0.1,
        n_degenerate_directions: 0,
        information: Matrix6::identity(),
        step_information: Matrix6::identity(),
        converged: true,
    };
    Registered {
        stamp: Stamp(stamp),
        duration_nanos,
        motion,
        path: Vec::new(),
        matched: Some(matched),
        contrast: None,
        predicted_by: PredictionSources { inertial: true, receiver },
        by_lidar: motion.mid,
        map_restarted: false,
        covariance: Matrix6::zeros(),
        moving: Vec::new(),
    }
}
