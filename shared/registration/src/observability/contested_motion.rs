//! Reports stretches of the drive where surrounding traffic makes the ego-motion ambiguous.

use crate::Registered;
use crate::observability::along_track::MIN_CONTRAST;
use crate::observability::time_spans::TimeSpans;
use doubts::Doubt;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Number of sweeps over which the contrast is averaged: one second.
const WINDOW: usize = 10;

/// Collects stretches with a low [`Registered::contrast`]. Serializing it saves the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContestedStretches {
    /// First shots and contrasts of the last sweeps.
    window: VecDeque<(i64, f64)>,
    spans: TimeSpans,
}

impl ContestedStretches {
    /// Adds the next sweep. Sweeps without contrast are skipped.
    pub fn add(&mut self, registered: &Registered) {
        if let Some(contrast) = registered.contrast {
            let end = registered.stamp.0 + i64::from(registered.duration_nanos);
            self.add_contrast([registered.stamp.0, end], contrast);
        }
    }

    fn add_contrast(&mut self, [stamp, end]: [i64; 2], contrast: f64) {
        self.spans.begin_drive(stamp);
        self.window.push_back((stamp, contrast));
        if self.window.len() > WINDOW {
            self.window.pop_front();
        }
        let mean = self.window.iter().map(|(_, contrast)| contrast).sum::<f64>() / WINDOW as f64;
        let is_contested = self.window.len() == WINDOW && mean < MIN_CONTRAST;
        let Some((begin, _)) = self.window.front().filter(|_| is_contested) else { return };
        self.spans.add([*begin, end], 0);
    }

    /// The doubt if all stretches together are longer than the limit, s.
    pub fn doubt(&self, limit_s: f64) -> Option<Doubt> {
        let seconds = self.spans.seconds();
        let stretches = || self.spans.describe();
        (seconds > limit_s).then(|| Doubt::MotionContested { seconds, limit_s, stretches: stretches() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(contrasts: &[f64]) -> ContestedStretches {
        let mut stretches = ContestedStretches::default();
        for (number, contrast) in contrasts.iter().enumerate() {
            let stamp = 7_000_000_000 + number as i64 * 100_000_000;
            stretches.add_contrast([stamp, stamp + 100_000_000], *contrast);
        }
        stretches
    }

    #[test]
    fn stretch_of_low_contrast_is_named_with_its_times() {
        let contrasts = [vec![0.5; 30], vec![0.0; 20], vec![0.5; 30], vec![0.0; 40]].concat();
        let found = after(&contrasts);
        assert_eq!(found.spans.describe(), "2.9 to 5.1 s, 7.9 to 12.0 s");
        assert!((found.spans.seconds() - 6.3).abs() < 1e-6, "{}", found.spans.seconds());
    }

    #[test]
    fn single_sweeps_of_low_contrast_are_no_stretch() {
        let contrasts: Vec<f64> = (0..100).map(|number| if number % 4 == 0 { -0.1 } else { 0.3 }).collect();
        assert_eq!(after(&contrasts), ContestedStretches { window: after(&contrasts).window, ..after(&[0.5]) });
        assert_eq!(after(&contrasts).spans.describe(), "");
    }

    #[test]
    fn description_names_the_longest_stretches() {
        let part = |n: usize| [vec![0.0; 10 + n], vec![0.9; 20]].concat();
        let found = after(&(1..=8).map(part).collect::<Vec<_>>().concat());
        assert!(found.spans.describe().ends_with(" and 3 more"), "{}", found.spans.describe());
    }
}
