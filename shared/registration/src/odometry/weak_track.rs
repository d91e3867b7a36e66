//! Where matches hardly constrain the along-track position, the overlap of rough surfaces with the map measures it, and the filter
//! predicts it.
//!
//! Guard rails, noise walls and the road constrain the other directions. What is left along the track are vehicles that move along
//! and errors of normals: the match then believes that the vehicle stands.

use crate::SweepMotion;
use crate::matching::rough_overlap::Overlap;
use crate::matching::{Matched, Prediction};
use crate::prediction::navigation::{PredictedPose, StepMeasurement};
use geometry::Pose;
use nalgebra::{Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Along-track influence below which a stretch starts, and above which it ends. With 0.01 and 0.02, motorway 106 of rig nuscenes
/// is 11 m off instead of 0.4 m.
const START_INFLUENCE: f64 = 0.015;
const END_INFLUENCE: f64 = 0.03;
/// Consecutive sweeps with a match before a measurement: a second. A younger map, and a map that sweeps were not matched to, may
/// be at a wrong place.
const MIN_MATCHED: u32 = 10;
/// Consecutive sweeps with a low influence before a measurement.
const MIN_WEAK: u32 = 3;
/// Rate of turn above which a stretch ends, rad/s: 30 m/s around a radius of 1000 m. At the junction of the sample, which turns by 0.36 rad/s, the
/// overlap bent the path by 1.2 degrees; with 0.08 by 0.7, with 0.03 by 0.4, without the overlap by 0.2.
const MAX_TURN_RADPS: f64 = 0.03;
/// Error of the last position in the map, m. Without inertial samples it adds to the error of the prediction. Chosen on motorways
/// 101 to 108: with 0.05 m, 108 of rig kitti is lost; with 0.2 m it ends 26 m off.
const MAP_ERROR_M: f64 = 0.1;
/// Compared shifts, in standard deviations of the prediction plus a constant, and at most, m.
const REACH_SIGMAS: f64 = 3.0;
const MORE_REACH_M: f64 = 0.2;
const MAX_REACH_M: f64 = 1.0;
/// Difference of a match from the overlap above which the overlap decides, in standard deviations of the overlap.
const REFUTED_SIGMAS: f64 = 2.0;
/// Weight of the measured position in a match, as a multiple of its information: the match does not move it.
const HOLD: f64 = 100.0;
/// Information of a measurement on the error that remains over a drive, as a multiple of its information: the map stays.
const DRIFT_SHARE: f64 = 10.0;

/// Counts the last sweeps whose match hardly constrained the along-track position; part of the odometry's saved state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct WeakTrack {
    n_matched: u32,
    n_weak: u32,
    /// Whether the overlap refuted a match since the constraint became weak.
    is_refuted: bool,
}

impl WeakTrack {
    /// Whether the overlap may measure the next sweep.
    pub fn is_measurable(&self) -> bool {
        self.n_matched >= MIN_MATCHED && self.n_weak >= MIN_WEAK
    }

    /// Adds the match of a sweep. A sweep without a match starts anew.
    pub fn update(&mut self, sweep: &MatchedSweep<'_>) {
        let MatchedSweep { matched, forward, turn_radps, is_left_to_receiver, is_by_overlap } = sweep;
        let Some(matched) = matched else {
            *self = Self::default();
            return;
        };
        self.n_matched = self.n_matched.saturating_add(1);
        let limit = if self.n_weak > 0 { END_INFLUENCE } else { START_INFLUENCE };
        let is_straight = *turn_radps < MAX_TURN_RADPS;
        let is_weak = is_straight && along_track_influence(matched, forward) < limit && !is_left_to_receiver;
        self.n_weak = if is_weak { self.n_weak.saturating_add(1) } else { 0 };
        self.is_refuted = is_weak && (self.is_refuted || *is_by_overlap);
    }

    /// Whether the overlap decides instead of the match: it refutes the match, or refuted one earlier in this stretch, and
    /// the map follows the overlap since. Without a match it decides.
    pub fn is_decided_by(
        &self,
        measured: &AlongTrackMeasurement,
        predicted: &SweepMotion,
        matched: Option<&SweepMotion>,
    ) -> bool {
        self.is_refuted || matched.is_none_or(|matched| measured.refutes(predicted, matched))
    }
}

/// A sweep after its match.
pub(crate) struct MatchedSweep<'a> {
    /// `None` without a match.
    pub matched: Option<&'a Matched>,
    /// Direction of travel, unit vector, odom axes.
    pub forward: Vector3<f64>,
    /// Rate of turn since the last sweep, rad/s.
    pub turn_radps: f64,
    /// Whether surrounding traffic makes the motion ambiguous, and a GNSS receiver measures the speed.
    pub is_left_to_receiver: bool,
    /// Whether the overlap decided on the along-track position.
    pub is_by_overlap: bool,
}

/// Mean squared influence of the along-track position on the residuals where all other directions are free, 0 to 1/3.
fn along_track_influence(matched: &Matched, forward: &Vector3<f64>) -> f64 {
    let along = pose_step(forward);
    let Some(factor) = matched.information.cholesky() else { return 0.0 };
    // The normals are unit vectors: the trace is the sum of the weights.
    1.0 / (along.dot(&factor.solve(&along)) * matched.information.fixed_view::<3, 3>(0, 0).trace())
}

fn pose_step(translation: &Vector3<f64>) -> Vector6<f64> {
    let mut step = Vector6::zeros();
    step.fixed_rows_mut::<3>(0).copy_from(translation);
    step
}

/// Predicted along-track position, as standard deviation, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AlongTrackPrior {
    /// Standard deviation of the prediction in the map, m.
    pub sigma_m: f64,
}

impl AlongTrackPrior {
    /// The prior of a step with this variance, m^2.
    pub fn from_step(variance: f64, sources_are_inertial: bool) -> Self {
        let map_m = if sources_are_inertial { 0.0 } else { MAP_ERROR_M };
        Self { sigma_m: (variance + map_m * map_m).sqrt() }
    }

    /// Largest shift to compare, m.
    pub fn reach_m(self) -> f64 {
        (REACH_SIGMAS * self.sigma_m + MORE_REACH_M).min(MAX_REACH_M)
    }
}

/// The along-track position of a sweep by prediction and overlap.
#[derive(Clone, Debug)]
pub(crate) struct AlongTrackMeasurement {
    /// Along-track step of a pose.
    along: Vector6<f64>,
    prior: AlongTrackPrior,
    overlap: Overlap,
}

impl AlongTrackMeasurement {
    /// `forward` is a unit vector, odom axes.
    pub fn new(forward: &Vector3<f64>, prior: AlongTrackPrior, overlap: Overlap) -> Self {
        Self { along: pose_step(forward), prior, overlap }
    }

    /// Whether a match is farther along the track from the measured position than both explain.
    fn refutes(&self, predicted: &SweepMotion, matched: &SweepMotion) -> bool {
        let shift = matched.mid.translation.vector - predicted.mid.translation.vector;
        let along_m = self.along.fixed_rows::<3>(0).dot(&shift);
        (along_m - self.overlap.shift_m).abs() > REFUTED_SIGMAS * self.overlap.sigma_m
    }

    fn square(&self) -> Matrix6<f64> {
        self.along * self.along.transpose()
    }

    /// The prediction, moved to the weighted mean of prediction and overlap, where a match keeps it.
    pub fn applied_to(&self, prediction: &Prediction) -> Prediction {
        let [prior, measured] = [self.prior.sigma_m, self.overlap.sigma_m].map(|sigma| sigma.powi(-2));
        let shift = self.along.fixed_rows::<3>(0) * (self.overlap.shift_m * measured / (prior + measured));
        let mut motion = prediction.motion;
        motion.mid = Pose::from_parts((motion.mid.translation.vector + shift).into(), motion.mid.rotation);
        motion.translation += shift * (prediction.duration_s / prediction.seconds);
        let information = prediction.information + self.square() * ((prior + measured) * HOLD);
        Prediction { motion, information, ..*prediction }
    }

    /// The measurement of a step with the overlap in place of the along-track information of the match.
    pub fn replaced_in(&self, measurement: &StepMeasurement) -> StepMeasurement {
        let without = |information: &Matrix6<f64>| {
            let column = information * self.along;
            let own = self.along.dot(&column);
            if own > 0.0 { information - column * column.transpose() / own } else { *information }
        };
        let measured = self.square() * self.overlap.sigma_m.powi(-2);
        StepMeasurement {
            information: without(&measurement.information) + measured,
            drift_information: without(&measurement.drift_information) + measured * DRIFT_SHARE,
        }
    }

    /// The prediction with the weight that it had in the measured position.
    pub fn weighted(&self, predicted: &PredictedPose) -> PredictedPose {
        PredictedPose { information: predicted.information + self.square() * self.prior.sigma_m.powi(-2), ..*predicted }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Isometry3;

    /// A match in which the along-track direction has this influence.
    fn matched(influence: f64) -> Matched {
        let mut information = Matrix6::identity();
        information[(0, 0)] = 2.0 * influence / (1.0 - influence);
        Matched {
            motion: SweepMotion::still(Pose::identity()),
            n_features: 1000,
            n_matches: 1000,
            rms_m: 0.02,
            cost: 0.1,
            least_influence: influence,
            n_degenerate_directions: 0,
            information,
            step_information: information,
            converged: true,
        }
    }

    /// Results of a sweep.
    #[derive(Clone, Copy, Debug)]
    struct Results {
        /// `None` without a match.
        influence: Option<f64>,
        turn_radps: f64,
        is_left_to_receiver: bool,
        is_by_overlap: bool,
    }

    fn after(sweeps: &[Results]) -> WeakTrack {
        let mut track = WeakTrack::default();
        for Results { influence, turn_radps, is_left_to_receiver, is_by_overlap } in sweeps {
            let matched = influence.map(matched);
            let is_left_to_receiver = *is_left_to_receiver;
            track.update(&MatchedSweep {
                matched: matched.as_ref(),
                forward: Vector3::x(),
                turn_radps: *turn_radps,
                is_left_to_receiver,
                is_by_overlap: *is_by_overlap,
            });
        }
        track
    }

    const WEAK: Results =
        Results { influence: Some(0.005), turn_radps: 0.01, is_left_to_receiver: false, is_by_overlap: false };
    const STREET: Results =
        Results { influence: Some(0.05), turn_radps: 0.01, is_left_to_receiver: false, is_by_overlap: false };

    #[test]
    fn influence_is_the_share_of_the_direction() {
        let found = along_track_influence(&matched(0.01), &Vector3::x());
        assert!((found - 0.01).abs() < 1e-9, "{found}");
    }

    #[test]
    fn second_of_matches_and_three_weak_ones_precede_a_measurement() {
        assert!(!after(&[WEAK; 9]).is_measurable());
        assert!(after(&[WEAK; 10]).is_measurable());
        assert!(!after(&[&[STREET; 20][..], &[WEAK; 2]].concat()).is_measurable());
        assert!(after(&[&[STREET; 20][..], &[WEAK; 3]].concat()).is_measurable());
        assert!(!after(&[STREET; 20]).is_measurable());
    }

    #[test]
    fn measurements_end_at_a_gap_in_a_street_in_traffic_and_in_a_turn() {
        let gap = Results { influence: None, turn_radps: 0.01, is_left_to_receiver: false, is_by_overlap: false };
        let traffic = Results { is_left_to_receiver: true, ..WEAK };
        let turn = Results { turn_radps: 0.3, ..WEAK };
        for end in [gap, STREET, traffic, turn] {
            assert!(!after(&[&[WEAK; 20][..], &[end]].concat()).is_measurable(), "{end:?}");
        }
        let less_weak = Results { influence: Some(0.02), ..WEAK };
        assert!(after(&[&[WEAK; 20][..], &[less_weak]].concat()).is_measurable(), "the limits differ");
    }

    #[test]
    fn overlap_that_refuted_a_match_decides_to_the_end_of_the_stretch() {
        let refuted = Results { is_by_overlap: true, ..WEAK };
        assert!(!after(&[WEAK; 20]).is_refuted);
        assert!(after(&[&[WEAK; 20][..], &[refuted], &[WEAK; 30]].concat()).is_refuted);
        for end in [STREET, Results { influence: None, ..WEAK }, Results { is_left_to_receiver: true, ..refuted }] {
            assert!(!after(&[&[refuted; 20][..], &[end], &[WEAK; 3]].concat()).is_refuted, "{end:?}");
        }
    }

    #[test]
    fn match_is_refuted_only_beyond_the_error_of_the_overlap() {
        let overlap = Overlap { shift_m: 0.5, sigma_m: 0.05 };
        let measured = AlongTrackMeasurement::new(&Vector3::x(), AlongTrackPrior { sigma_m: 0.2 }, overlap);
        let at = |x: f64, y: f64| SweepMotion::still(Isometry3::translation(x, y, 0.0));
        let refutes = |x: f64, y: f64| measured.refutes(&at(10.0, 0.0), &at(10.0 + x, y));
        assert!(!refutes(0.5, 0.0) && !refutes(0.59, 3.0) && !refutes(0.41, 0.0));
        assert!(refutes(0.0, 0.0) && refutes(0.61, 0.0));
    }

    #[test]
    fn overlap_replaces_the_along_track_information_of_the_match() {
        let overlap = Overlap { shift_m: 0.3, sigma_m: 0.1 };
        let measured = AlongTrackMeasurement::new(&Vector3::x(), AlongTrackPrior { sigma_m: 0.1 }, overlap);
        let claimed = Matrix6::from_diagonal_element(1e6);
        let found = measured.replaced_in(&StepMeasurement { information: claimed, drift_information: claimed });
        assert!((found.information[(0, 0)] - 100.0).abs() < 1e-6, "{}", found.information);
        assert!((found.information[(1, 1)] - 1e6).abs() < 1e-6, "{}", found.information);
    }
}
