//! The visited places of a drive, represented by keyframes.

use super::finder::{LoopClosure, LoopFinder};
use super::keyframe::Keyframe;
use serde::{Deserialize, Serialize};

/// Distance within which a keyframe replaces the keyframe that it closes a loop with, m: half a submap of the default
/// length, which is the largest distance at which a later visit is recognized.
const SAME_PLACE_M: f64 = 10.0;

/// Keyframes in drive order. Memory: up to 80 kB each. A place that is visited again keeps only the newest keyframe:
/// the odometry has drifted least since then.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Places {
    keyframes: Vec<Keyframe>,
}

impl Places {
    /// Searches a loop closure of `keyframe` and keeps the keyframe. Beyond `max_keyframes` the oldest one is dropped.
    pub fn visit(&mut self, keyframe: Keyframe, finder: &LoopFinder, max_keyframes: usize) -> Option<LoopClosure> {
        let closure = finder.find(&keyframe, &self.keyframes);
        if let Some(closure) = &closure {
            self.keyframes.retain(|earlier| !is_same_place(earlier, &keyframe, closure));
        }
        self.keyframes.push(keyframe);
        let n_over = self.keyframes.len().saturating_sub(max_keyframes.max(1));
        self.keyframes.drain(..n_over);
        closure
    }

    /// The newest keyframe.
    pub fn last(&self) -> Option<&Keyframe> {
        self.keyframes.last()
    }

    /// Number of keyframes.
    pub fn len(&self) -> usize {
        self.keyframes.len()
    }

    /// Whether no place has been visited.
    pub fn is_empty(&self) -> bool {
        self.keyframes.is_empty()
    }
}

/// Whether `later` closes the loop with `earlier`, and both are at the same place.
fn is_same_place(earlier: &Keyframe, later: &Keyframe, closure: &LoopClosure) -> bool {
    let later_in_earlier = closure.relative.target_from_source * later.submap_from_body;
    let apart = later_in_earlier.translation.vector - earlier.submap_from_body.translation.vector;
    earlier.submap == closure.relative.target && apart.norm() < SAME_PLACE_M
}
