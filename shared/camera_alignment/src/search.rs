//! Search of rotations and delay: a grid search, followed by coordinate ascent with decreasing steps.

use crate::offset::Rotation;
use crate::outlines::CameraOutlines;
use rayon::prelude::*;

/// Largest rotation about each axis, rad: 2.5 degrees.
const MAX_ROTATION: f32 = 0.044;

/// Largest delay, s.
const MAX_DELAY_S: f32 = 0.15;

/// Steps of the grid search: the width of the peak of a smoothed profile.
const ROTATION_STEP: f32 = 0.004;
const DELAY_STEP_S: f32 = 0.01;

/// Step for rotations about the optical axis, which move edges by about a third as much.
const AXIS_STEP: f32 = 0.012;

/// Rotations of all cameras and their common delay.
#[derive(Clone)]
pub struct Solution {
    /// Rotation of each camera.
    pub rotations: Vec<Rotation>,
    /// Common delay, s.
    pub delay_s: f32,
}

/// A solution with the sum of the scores of all cameras.
struct ScoredSolution {
    score: f32,
    solution: Solution,
}

impl Solution {
    /// Grid search over all rotations, and over all delays with `may_be_late`.
    pub fn search(cameras: &[CameraOutlines<'_>], may_be_late: bool) -> Self {
        let n_delays = if may_be_late { (MAX_DELAY_S / DELAY_STEP_S).round() as i32 } else { 0 };
        let delays: Vec<f32> = (-n_delays..=n_delays).map(|i| i as f32 * DELAY_STEP_S).collect();
        let at_delay = |&delay_s: &f32| {
            let found: Vec<ScoredRotation> =
                cameras.par_iter().map(|outlines| best_on_grid(outlines, delay_s)).collect();
            let score = found.iter().map(|found| found.score).sum();
            let rotations = found.into_iter().map(|found| found.rotation).collect();
            ScoredSolution { score, solution: Self { rotations, delay_s } }
        };
        // The first of equally good delays.
        let better = |best: ScoredSolution, found: ScoredSolution| if found.score > best.score { found } else { best };
        let found: Vec<ScoredSolution> = delays.par_iter().map(at_delay).collect();
        let best = found.into_iter().reduce(better);
        best.map_or_else(|| Self { rotations: vec![[0.0; 3]; cameras.len()], delay_s: 0.0 }, |best| best.solution)
    }

    /// Coordinate ascent with decreasing steps, one unknown after another, while the score rises.
    pub fn refined(mut self, cameras: &[CameraOutlines<'_>], may_be_late: bool) -> Self {
        let mut rotation_step = ROTATION_STEP;
        let mut delay_step = DELAY_STEP_S;
        // Seven halvings: 31 urad and 78 us.
        for _ in 0..7 {
            // A few rounds reach the next grid point. The limit ends cycles caused by rounding.
            for _ in 0..6 {
                let mut is_better = false;
                for (outlines, rotation) in cameras.iter().zip(&mut self.rotations) {
                    is_better |= climb(outlines, rotation, self.delay_s, rotation_step);
                }
                is_better |= may_be_late && self.climb_delay(cameras, delay_step, rotation_step);
                if !is_better {
                    break;
                }
            }
            rotation_step *= 0.5;
            delay_step *= 0.5;
        }
        self
    }

    /// One step of the delay, followed by a fit of all rotations.
    fn climb_delay(&mut self, cameras: &[CameraOutlines<'_>], delay_step: f32, rotation_step: f32) -> bool {
        let score = self.score(cameras);
        for step in [-delay_step, delay_step] {
            let mut moved = Self { delay_s: self.delay_s + step, ..self.clone() };
            if moved.delay_s.abs() > MAX_DELAY_S {
                continue;
            }
            for (outlines, rotation) in cameras.iter().zip(&mut moved.rotations) {
                for _ in 0..4 {
                    climb(outlines, rotation, moved.delay_s, rotation_step);
                }
            }
            if moved.score(cameras) > score {
                *self = moved;
                return true;
            }
        }
        false
    }

    fn score(&self, cameras: &[CameraOutlines<'_>]) -> f32 {
        let pairs = cameras.iter().zip(&self.rotations);
        pairs.map(|(outlines, rotation)| outlines.score(*rotation, self.delay_s)).sum()
    }

    /// Height of the peak of all cameras together, see [`CameraOutlines::peak`].
    pub fn peak(&self, cameras: &[CameraOutlines<'_>]) -> f32 {
        let pairs = cameras.iter().zip(&self.rotations);
        let squares = pairs.map(|(outlines, rotation)| outlines.peak(*rotation, self.delay_s).powi(2));
        squares.sum::<f32>().sqrt()
    }
}

/// A rotation with its score.
#[derive(Clone, Copy, Debug)]
pub struct ScoredRotation {
    pub score: f32,
    pub rotation: Rotation,
}

/// The best rotation on the grid of all fitted axes.
pub fn best_on_grid(outlines: &CameraOutlines<'_>, delay_s: f32) -> ScoredRotation {
    let grid = |axis: usize, step: f32| {
        let n = if axis < outlines.axes.len() { (MAX_ROTATION / step).round() as i32 } else { 0 };
        (-n..=n).map(move |i| i as f32 * step)
    };
    let step = |axis: usize| if axis < outlines.n_across { ROTATION_STEP } else { AXIS_STEP };
    let mut rotations = Vec::new();
    for a in grid(0, step(0)) {
        for b in grid(1, step(1)) {
            for c in grid(2, step(2)) {
                let axes = outlines.axes.iter().zip([a, b, c]);
                rotations.push(axes.fold([0.0; 3], |rotation, (axis, step)| moved(rotation, *axis, step)));
            }
        }
    }
    let mut best = ScoredRotation { score: f32::NEG_INFINITY, rotation: [0.0; 3] };
    for (score, rotation) in outlines.coarse_scores(&rotations, delay_s).into_iter().zip(rotations) {
        if score > best.score {
            best = ScoredRotation { score, rotation };
        }
    }
    best
}

/// One step about each axis, if it raises the score.
fn climb(outlines: &CameraOutlines<'_>, rotation: &mut Rotation, delay_s: f32, step: f32) -> bool {
    let mut is_better = false;
    let mut score = outlines.score(*rotation, delay_s);
    for axis in &outlines.axes {
        for step in [-step, step] {
            let moved = moved(*rotation, *axis, step);
            let found = outlines.score(moved, delay_s);
            if found > score && moved[0].hypot(moved[1]) <= 1.5 * MAX_ROTATION {
                score = found;
                *rotation = moved;
                is_better = true;
                break;
            }
        }
    }
    is_better
}

fn moved(rotation: Rotation, axis: Rotation, step: f32) -> Rotation {
    [0, 1, 2].map(|i| rotation[i] + step * axis[i])
}
