//! Reports stretches of the drive whose sweeps have no match: their path is a prediction, or rest.

use crate::Registered;
use crate::observability::time_spans::TimeSpans;
use doubts::Doubt;
use geometry::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Number of successive sweeps that are examined together: one second.
const WINDOW: usize = 10;
/// Sweeps without a match among them that make a stretch. As many in a row abandon the map. Fewer lie between matches
/// to the same map, which support the path on both sides.
///
/// The number follows from that limit. As a check: KITTI raw 0048, both Annieway drives, the sample, and 6 s each of simulated urban, suburban, rural, field, tunnel and
/// motorway drives have no sweep without a match.
const MIN_UNMATCHED: usize = 5;
/// Stretches with a shorter pause are listed as one, ns.
const PAUSE_NANOS: i64 = 1_000_000_000;

/// A sweep of the window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Step {
    is_matched: bool,
    /// From the last shot of the previous sweep to the last shot of this one, ns.
    span: [i64; 2],
    /// Distance from the pose of the previous sweep, m.
    path_m: f64,
    /// Whether it belongs to a stretch already.
    is_counted: bool,
}

/// Collects stretches in which sweeps have no match. Serializing it saves the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UnmatchedStretches {
    /// Position and last shot of the previous sweep.
    last: Option<(Vector3<f64>, i64)>,
    window: VecDeque<Step>,
    n_drive: u64,
    n_matched: u64,
    /// First and last shot of the drive, ns.
    drive: [i64; 2],
    /// Sweeps without a match in the stretches, their time and their path.
    n_unmatched: u64,
    nanos: i64,
    path_m: f64,
    spans: TimeSpans,
}

impl UnmatchedStretches {
    /// Adds the next sweep.
    pub fn add(&mut self, registered: &Registered) {
        let shots = [registered.stamp.0, registered.end_stamp().0];
        self.add_sweep(shots, registered.motion.mid.translation.vector, registered.matched.is_some());
    }

    fn add_sweep(&mut self, [begin, end]: [i64; 2], position: Vector3<f64>, is_matched: bool) {
        self.spans.begin_drive(begin);
        let (before, before_end) = self.last.replace((position, end)).unwrap_or((position, begin));
        if self.n_drive == 0 {
            self.drive[0] = begin;
        }
        self.drive[1] = end;
        self.n_drive += 1;
        self.n_matched += u64::from(is_matched);
        // Sweeps may overlap, and some have no duration.
        let span = [before_end.min(end), end];
        self.window.push_back(Step { is_matched, span, path_m: (position - before).norm(), is_counted: false });
        if self.window.len() > WINDOW {
            self.window.pop_front();
        }
        if self.window.iter().filter(|step| !step.is_matched).count() < MIN_UNMATCHED {
            return;
        }
        for step in self.window.iter_mut().filter(|step| !step.is_matched && !step.is_counted) {
            step.is_counted = true;
            self.n_unmatched += 1;
            self.nanos += step.span[1] - step.span[0];
            self.path_m += step.path_m;
            self.spans.add(step.span, PAUSE_NANOS);
        }
    }

    /// The doubt if no sweep of the drive was matched, or if all stretches together are longer than the limit, s.
    pub fn doubt(&self, limit_s: f64) -> Option<Doubt> {
        // A single sweep has nothing to be matched to.
        if self.n_drive > 1 && self.n_matched == 0 {
            let seconds = (self.drive[1] - self.drive[0]) as f64 * 1e-9;
            return Some(Doubt::NoSweepMatched { n_sweeps: self.n_drive, seconds });
        }
        let seconds = self.nanos as f64 * 1e-9;
        (seconds > limit_s).then(|| Doubt::PathUnmatched {
            n_unmatched: self.n_unmatched,
            n_sweeps: self.n_drive,
            seconds,
            path_m: self.path_m,
            limit_s,
            stretches: self.spans.describe(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stretches after sweeps of 0.1 s, 2 m apart, matched or not.
    fn after(sweeps: &[bool]) -> UnmatchedStretches {
        let mut stretches = UnmatchedStretches::default();
        for (number, is_matched) in sweeps.iter().enumerate() {
            let begin = 5_000_000_000 + number as i64 * 100_000_000;
            let position = Vector3::new(2.0 * number as f64, 0.0, 0.0);
            stretches.add_sweep([begin, begin + 100_000_000], position, *is_matched);
        }
        stretches
    }

    #[test]
    fn stretch_without_match_is_stated_with_sweeps_seconds_and_metres() {
        let sweeps = [vec![true; 20], vec![false; 8], vec![true; 30]].concat();
        let doubt = after(&sweeps).doubt(0.0).expect("eight sweeps in a row have no match");
        let text = doubt.to_string();
        assert!((doubt.size() - 0.8).abs() < 1e-9, "{}", doubt.size());
        for part in ["8 of 58 sweeps", "0.8 s", "16.0 m", "(2.0 to 2.8 s)", "more than max_unmatched_s = 0"] {
            assert!(text.contains(part), "{part} is not in: {text}");
        }
        assert_eq!(after(&sweeps).doubt(0.8), None, "the limit is a setting");
    }

    #[test]
    fn gaps_between_matches_to_the_same_map_are_no_doubt() {
        assert_eq!(after(&[vec![true; 20], vec![false; 4], vec![true; 20]].concat()).doubt(0.0), None);
        let each_third = |number: usize| !number.is_multiple_of(3);
        assert_eq!(after(&(0..300).map(each_third).collect::<Vec<_>>()).doubt(0.0), None);
    }

    #[test]
    fn few_matches_between_many_gaps_are_a_doubt() {
        let each_fifth = |number: usize| number.is_multiple_of(5);
        let doubt = after(&(0..100).map(each_fifth).collect::<Vec<_>>()).doubt(0.0).expect("most have no match");
        assert!((doubt.size() - 8.0).abs() < 1e-9, "{doubt}");
    }

    #[test]
    fn drive_without_any_match_is_a_doubt_whatever_the_limit() {
        for n in [2, 4, 120] {
            let doubt = after(&vec![false; n]).doubt(1e6).expect("no sweep has a match");
            let expected = Doubt::NoSweepMatched { n_sweeps: n as u64, seconds: n as f64 * 0.1 };
            assert_eq!((doubt.kind(), doubt.to_string()), (expected.kind(), expected.to_string()));
        }
        assert_eq!([&[][..], &[false]].map(|sweeps| after(sweeps).doubt(0.0)), [None, None]);
    }

    #[test]
    fn time_of_sweeps_without_duration_is_the_time_since_the_previous_sweep() {
        let mut stretches = UnmatchedStretches::default();
        for number in 0..20_i64 {
            stretches.add_sweep([number * 100_000_000; 2], Vector3::zeros(), number < 10);
        }
        assert!(stretches.doubt(0.99).is_some() && stretches.doubt(1.01).is_none());
    }
}
