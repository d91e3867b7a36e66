//! Match of a sweep whose prediction is beyond the search radius of a match: after fast turns, between distant sweeps, and after
//! sweeps without a match.

use super::acceptance::{is_plausible, largest_jump};
use super::distant::{MAX_DISTANT_S, settings_at};
use super::top_view::{SearchExtent, poses_by_top_view};
use super::upright_cost::upright_cost;
use super::{Last, Odometry};
use crate::features::sweep_features::SweepFeatures;
use crate::matching::{LEVER_M, Match, Prediction, match_features};
use crate::motion::Velocity;
use crate::{Feature, MatchSettings, SweepMotion};
use geometry::{Isometry3, Pose};
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};

/// A prediction that is wrong by more, at a range of 10 m, is beyond the search radius of a match, m.
const WRONG_PREDICTION_M: f64 = 0.5;
/// Matched candidates of a search. Six give the same share of right steps on muehlburger at 1 Hz, and cost more.
const N_CANDIDATES: usize = 4;
/// Rounds with the coarse radius from a candidate, whose error is up to half a metre.
const COARSE_ROUNDS: u32 = 6;
/// A candidate must lower the cost of the match at the prediction by this factor: equal costs keep the prediction.
const BETTER_FACTOR: f64 = 0.9;
/// Increase of the cost of a pose one standard deviation of the prediction away, as a share: facades with equal windows repeat every
/// few metres. Chosen on urban 31 and suburban 32 at 1 Hz.
const PRIOR_WEIGHT: f64 = 0.2;
/// Least standard deviation of a prediction, m.
const PRIOR_M: f64 = 0.5;
/// Limits of a search: the fastest turns of a person between two sweeps, and the range of the compared surfaces.
const MAX_TURN_RAD: f64 = 1.75;
const MAX_SHIFT_M: f64 = 12.0;

/// Error of the last predictions; part of the odometry's saved state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct PredictionError {
    /// Error of the prediction of the last match, m at a range of 10 m.
    last_m: f64,
    /// Time without a match, s.
    unmatched_s: f64,
}

impl PredictionError {
    /// Adds a sweep, `seconds` after the last one. `matched`: `None` without a match.
    pub fn update(&mut self, predicted: &Pose, matched: Option<&Pose>, seconds: f64) {
        *self = match matched {
            Some(matched) => Self { last_m: distance_m(predicted, matched), unmatched_s: 0.0 },
            None => Self { unmatched_s: self.unmatched_s + seconds, ..*self },
        };
    }
}

/// Distance of two poses, with the rotation at a range of 10 m, m.
fn distance_m(a: &Pose, b: &Pose) -> f64 {
    (a.translation.vector - b.translation.vector).norm() + LEVER_M * a.rotation.angle_to(&b.rotation)
}

impl Odometry {
    /// A match far from the prediction that is better than `found`, the acceptable match at the prediction. `None` if the prediction
    /// is good, or if no other pose fits better.
    pub(super) fn wide_match(
        &self,
        features: &SweepFeatures,
        samples: &[Feature],
        last: &Last,
        prediction: &Prediction,
        found: Option<&Match>,
    ) -> Option<Match> {
        let error = &self.state.prediction_error;
        let predicted = &prediction.motion.mid;
        let shift_m = found.map_or(f64::INFINITY, |found| distance_m(predicted, &found.matched.motion.mid));
        if shift_m.max(error.last_m) < WRONG_PREDICTION_M {
            return None;
        }
        let seconds = prediction.seconds + error.unmatched_s;
        if seconds > MAX_DISTANT_S {
            return None;
        }
        let jump = largest_jump(seconds);
        let turned_rad = last.mid.rotation.angle_to(&predicted.rotation);
        let extent = SearchExtent {
            turn_rad: (jump.turn_rad + turned_rad).min(MAX_TURN_RAD),
            shift_m: jump.shift_m.min(MAX_SHIFT_M),
        };
        // Inclination and heading as in the last sweep: an extrapolated turn about any axis is often wrong.
        let mid = Isometry3::from_parts(predicted.translation, last.mid.rotation);
        let motion = SweepMotion { mid, ..prediction.motion };
        let candidates = poses_by_top_view(&features.features, self.maps.points(), &motion, &extent, N_CANDIDATES);
        let settings = MatchSettings {
            coarse_rounds: COARSE_ROUNDS,
            ..settings_at(&self.settings.matching, prediction.seconds).into_owned()
        };
        let match_at = |mid: &Pose| {
            let velocity = Velocity::between(&last.mid, mid, prediction.seconds);
            let motion = velocity.motion_at(*mid, prediction.duration_s);
            let candidate = Prediction { motion, information: Matrix6::zeros(), ..*prediction };
            match_features(samples, &self.maps, &candidate, &settings)
        };
        let sigma_m = PRIOR_M + self.settings.matching.acceleration.linear_mps2 * seconds * seconds;
        let cost = |found: &Match| {
            let motion = &found.matched.motion;
            let off_m = (motion.mid.translation.vector - predicted.translation.vector).norm();
            let cost = upright_cost(samples, &self.maps, motion, &settings);
            cost * (1.0 + PRIOR_WEIGHT * (off_m / sigma_m).powi(2))
        };
        let (best_cost, best) = candidates
            .iter()
            .filter_map(match_at)
            .filter(|found| is_plausible(&found.matched, prediction.seconds))
            .map(|found| (cost(&found), found))
            .min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        let limit = found.map_or(f64::INFINITY, |found| cost(found) * BETTER_FACTOR);
        (best_cost < limit).then_some(best)
    }
}
