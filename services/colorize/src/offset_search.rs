//! How far the outlines that the LiDAR saw are from those that the cameras saw: how it is looked for.

use crate::offset_edges::Edges;
use rayon::prelude::*;

/// A camera's turn, rad about its own x (up), y (to the right) and z (its axis, with the hands of a clock).
pub type Turn = [f32; 3];

/// Turns that are looked for, rad: 2.5 degrees.
const MAX_TURN: f32 = 0.044;

/// Delays that are looked for, s.
const MAX_DELAY_S: f32 = 0.15;

/// First steps of the search: as wide as a smoothed profile's peak.
const TURN_STEP: f32 = 0.004;
const DELAY_STEP_S: f32 = 0.01;

/// The same for turns about the axis, which move edges by a third of it.
const AXIS_STEP: f32 = 0.012;

/// Turns of all cameras and the delay that they share.
#[derive(Clone)]
pub struct Solution {
    /// By camera.
    pub turns: Vec<Turn>,
    /// s.
    pub delay_s: f32,
}

impl Solution {
    /// Over all turns about x and y, and all delays if there may be one.
    pub fn search(cameras: &[Edges<'_>], may_be_late: bool) -> Self {
        let n_delays = if may_be_late { (MAX_DELAY_S / DELAY_STEP_S).round() as i32 } else { 0 };
        let delays: Vec<f32> = (-n_delays..=n_delays).map(|i| i as f32 * DELAY_STEP_S).collect();
        let at_delay = |delay_s: &f32| -> (f32, Self) {
            let found: Vec<(f32, Turn)> = cameras.par_iter().map(|edges| searched(edges, *delay_s)).collect();
            let score = found.iter().map(|(score, _)| score).sum();
            (score, Self { turns: found.into_iter().map(|(_, turn)| turn).collect(), delay_s: *delay_s })
        };
        // Of delays as good as each other the first.
        let better = |best: (f32, Self), found: (f32, Self)| if found.0 > best.0 { found } else { best };
        let found: Vec<(f32, Self)> = delays.par_iter().map(at_delay).collect();
        let best = found.into_iter().reduce(better);
        best.map_or_else(|| Self { turns: vec![[0.0; 3]; cameras.len()], delay_s: 0.0 }, |(_, solution)| solution)
    }

    /// By ever smaller steps, along one unknown after the other, as long as the sum rises.
    pub fn refined(mut self, cameras: &[Edges<'_>], may_be_late: bool) -> Self {
        let (mut turn_step, mut delay_step) = (TURN_STEP, DELAY_STEP_S);
        // Seven halvings: 31 urad and 78 us.
        for _ in 0..7 {
            // Few rounds climb from one grid place to the next; the bound is for sums that go round in circles of rounding.
            for _ in 0..6 {
                let mut is_better = false;
                for (edges, turn) in cameras.iter().zip(&mut self.turns) {
                    is_better |= climb(edges, turn, self.delay_s, turn_step);
                }
                is_better |= may_be_late && self.climb_delay(cameras, delay_step, turn_step);
                if !is_better {
                    break;
                }
            }
            turn_step *= 0.5;
            delay_step *= 0.5;
        }
        self
    }

    /// A step of the delay, to which all turns are fitted anew.
    fn climb_delay(&mut self, cameras: &[Edges<'_>], delay_step: f32, turn_step: f32) -> bool {
        let score = self.score(cameras);
        for step in [-delay_step, delay_step] {
            let mut moved = Self { delay_s: self.delay_s + step, ..self.clone() };
            if moved.delay_s.abs() > MAX_DELAY_S {
                continue;
            }
            for (edges, turn) in cameras.iter().zip(&mut moved.turns) {
                for _ in 0..4 {
                    climb(edges, turn, moved.delay_s, turn_step);
                }
            }
            if moved.score(cameras) > score {
                *self = moved;
                return true;
            }
        }
        false
    }

    fn score(&self, cameras: &[Edges<'_>]) -> f32 {
        cameras.iter().zip(&self.turns).map(|(edges, turn)| edges.score(*turn, self.delay_s)).sum()
    }

    /// Of all cameras together, see [`Edges::peak`].
    pub fn peak(&self, cameras: &[Edges<'_>]) -> f32 {
        let squares = cameras.iter().zip(&self.turns).map(|(edges, turn)| edges.peak(*turn, self.delay_s).powi(2));
        squares.sum::<f32>().sqrt()
    }
}

/// The best of all turns that the edges have axes for, to the steps of the search, with its score.
pub fn searched(edges: &Edges<'_>, delay_s: f32) -> (f32, Turn) {
    let places = |axis: usize, step: f32| {
        let n = if axis < edges.axes.len() { (MAX_TURN / step).round() as i32 } else { 0 };
        (-n..=n).map(move |i| i as f32 * step)
    };
    let step = |axis: usize| if axis < edges.n_across { TURN_STEP } else { AXIS_STEP };
    let mut turns = Vec::new();
    for a in places(0, step(0)) {
        for b in places(1, step(1)) {
            for c in places(2, step(2)) {
                let axes = edges.axes.iter().zip([a, b, c]);
                turns.push(axes.fold([0.0; 3], |turn, (axis, step)| moved(turn, *axis, step)));
            }
        }
    }
    let mut best = (f32::NEG_INFINITY, [0.0; 3]);
    for (score, turn) in edges.coarse_scores(&turns, delay_s).into_iter().zip(turns) {
        if score > best.0 {
            best = (score, turn);
        }
    }
    best
}

/// One step about each axis, where it is better.
fn climb(edges: &Edges<'_>, turn: &mut Turn, delay_s: f32, step: f32) -> bool {
    let mut is_better = false;
    let mut score = edges.score(*turn, delay_s);
    for axis in &edges.axes {
        for step in [-step, step] {
            let moved = moved(*turn, *axis, step);
            let found = edges.score(moved, delay_s);
            if found > score && moved[0].hypot(moved[1]) <= 1.5 * MAX_TURN {
                (score, *turn, is_better) = (found, moved, true);
                break;
            }
        }
    }
    is_better
}

fn moved(turn: Turn, axis: Turn, step: f32) -> Turn {
    [0, 1, 2].map(|i| turn[i] + step * axis[i])
}
