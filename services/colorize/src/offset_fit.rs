//! How far the outlines that the LiDAR saw are from those that the cameras saw: what is found.
//!
//! Unknown are a turn of each camera, up, to the side and about its axis, and a delay that all shutters share, since one trigger fires them. A turn moves
//! all edges of a camera alike, whatever their range; a delay moves near ones more than far ones, those ahead outward and those at the side
//! backward. So both can be told apart where the vehicle moves and the edges are at different ranges; elsewhere
//! the delay is said to be unknown, and the turns hold for a delay of zero.

use crate::offset::Profile;
use crate::offset_edges::{Edges, Outline};
pub use crate::offset_search::Turn;
use crate::offset_search::{Solution, searched};
use rayon::prelude::*;
use std::ops::Range;

/// Fewer edges say nothing.
const MIN_EDGES: usize = 150;

/// A peak of so many standard deviations of what chance gives is one. Edges of one outline are not independent, so it is more than
/// 4 of them would be: with errors planted in rig l3d2 on seeds 41, 42 and 44 right peaks have 12 and more, wrong ones mostly 9 and 10.
const SIGNIFICANT: f32 = 11.0;

/// A delay, or a turn about the axis, is one if the square of the peak rises by the square of this.
const SIGNIFICANT_DELAY: f32 = 8.0;

/// Parts of the edges that lie farther apart, rad, do not speak of one turn: each has found a peak of its own.
const AGREED: f32 = 2.5e-3;

/// Parts of the drive, one after the other, that are left out one by one to see by how much the rest differs (the jackknife; Efron, "The
/// Jackknife, the Bootstrap and Other Resampling Plans", 1982). Edges of one part are of the same outlines, so parts that interleave would
/// agree on their errors.
const N_PARTS: usize = 8;

/// A turn about the axis that is less than so many of its deviations is left at none: a high peak may come from a turn that the edges do not tell.
const MIN_DEVIATIONS: f32 = 2.0;

/// Deviation of one edge's outline from where it should be, steps: what makes of the deviations of the delay that of an edge: 2 to 12 steps for 0.3 to 2 ms on
/// rigs l3d2 (seeds 41 and 42) and nuscenes (21 and 22). Many edges are of one outline, so it is more than an outline's own.
const EDGE_STEPS: f32 = 8.0;

/// What of the delay's error all parts of a drive have in common, steps: errors of delays up to 60 ms are 0.4 ms (nuscenes) and 1.4 ms (l3d2) on these drives.
const COMMON_DELAY_STEPS: f32 = 0.1;

/// A delay whose deviation would be larger, s, is not observable: 10 ms would be no more than three of them.
const OBSERVABLE_DELAY_S: f32 = 0.003;

/// What was found about one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraOffset {
    /// How the camera must be turned in its own frame to agree with the points: `p_true = turn * p_as_mounted`.
    pub turn: Turn,
    /// Whether a turn about the axis is found beyond doubt; else it is 0.
    pub is_turned_about_axis: bool,
    /// Whether nothing is known of a turn along the outlines, because all of them run about the same way; it is left at 0.
    pub is_across_alone: bool,
    /// Standard deviation of the turn, from parts of the drive, rad.
    pub deviation: Turn,
    /// Edges.
    pub n_edges: usize,
    /// Height of the peak, in standard deviations of what chance gives.
    pub peak: f32,
}

impl CameraOffset {
    /// Whether the peak is more than chance, and one for all parts of the edges.
    pub fn is_found(&self) -> bool {
        self.n_edges >= MIN_EDGES && self.peak >= SIGNIFICANT && self.sigma() <= AGREED
    }
    /// Whether it is turned by more than this, rad, beyond doubt.
    pub fn exceeds(&self, angle: f32) -> bool {
        self.is_found() && self.angle() - 3.0 * self.sigma() > angle
    }
    /// Standard deviation of where the middle of the image is, rad.
    pub fn sigma(&self) -> f32 {
        self.deviation[0].hypot(self.deviation[1])
    }
    /// How far the middle of the image is off, rad.
    pub fn angle(&self) -> f32 {
        self.turn[0].hypot(self.turn[1])
    }
}

/// What was found about all cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct Offset {
    /// How much later than its stamp the exposure was, s, and the standard deviation; `None` where it cannot be told.
    pub delay_s: Option<[f32; 2]>,
    /// Whether the edges could tell a delay: where they would move as by turns, they cannot.
    pub tells_delay: bool,
    /// By index.
    pub cameras: Vec<CameraOffset>,
}

/// Fits turns and delay to each camera's profiles.
pub fn fit(cameras: &[Vec<Profile>]) -> Offset {
    let outlines: Vec<Vec<Outline>> =
        cameras.par_iter().map(|profiles| profiles.iter().map(Outline::from).collect()).collect();
    let all: Vec<Edges<'_>> = outlines.iter().map(|outlines| Edges::new(outlines.iter())).collect();
    let still = Solution::search(&all, false);
    let moved = Solution::search(&all, true).refined(&all, true);
    let still = still.refined(&all, false);
    let gain = moved.peak(&all).powi(2) - still.peak(&all).powi(2);
    let has_delay = gain > SIGNIFICANT_DELAY.powi(2);
    // A delay of nothing is as good as any other if it could have been seen.
    let solution = if has_delay { moved } else { still };
    let (all, solution) = with_turns_about_axes(&outlines, all, solution, has_delay);
    let parts = parts(&outlines, &all, &solution, has_delay);
    let camera = |(i, edges): (usize, &Edges<'_>)| CameraOffset {
        turn: solution.turns[i],
        deviation: [0, 1, 2]
            .map(|axis| deviation(&parts, |part| part.turns[i][axis]).hypot(edges.common_deviation(axis))),
        is_turned_about_axis: edges.axes.len() > edges.n_across,
        is_across_alone: edges.n_across < 2,
        n_edges: edges.n_edges(),
        peak: edges.peak(solution.turns[i], solution.delay_s),
    };
    let n_edges = all.iter().map(Edges::n_edges).sum::<usize>() as f32;
    let steps_per_s = all.iter().map(Edges::delay_square).sum::<f32>().sqrt();
    let common_s = COMMON_DELAY_STEPS * n_edges.sqrt() / steps_per_s.max(1e-6);
    Offset {
        tells_delay: has_delay || steps_per_s * OBSERVABLE_DELAY_S > EDGE_STEPS,
        delay_s: has_delay.then(|| [solution.delay_s, deviation(&parts, |part| part.delay_s).hypot(common_s)]),
        cameras: all.iter().enumerate().map(camera).collect(),
    }
}

/// The solutions without one part of the drive after the other.
fn parts(outlines: &[Vec<Outline>], all: &[Edges<'_>], solution: &Solution, has_delay: bool) -> Vec<Solution> {
    let without = |part: usize| {
        let rest_of_each = outlines.iter().zip(all).map(|(outlines, edges)| {
            let [begin, end] = [part, part + 1].map(|part| part * outlines.len() / N_PARTS);
            let mut rest = Edges::new(outlines[..begin].iter().chain(&outlines[end..]));
            rest.axes.clone_from(&edges.axes);
            rest
        });
        let rest: Vec<Edges<'_>> = rest_of_each.collect();
        solution.clone().refined(&rest, has_delay)
    };
    (0..N_PARTS).into_par_iter().map(without).collect()
}

/// Of a value that the parts differ in.
fn deviation(parts: &[Solution], value: impl Fn(&Solution) -> f32) -> f32 {
    let n = N_PARTS as f32;
    let mean = parts.iter().map(&value).sum::<f32>() / n;
    let square: f32 = parts.iter().map(|part| (value(part) - mean).powi(2)).sum();
    (square * (n - 1.0) / n).sqrt()
}

/// Lets those cameras turn about their axes whose edges then agree by far better: elsewhere one more unknown would only add its noise.
fn with_turns_about_axes<'a>(
    outlines: &[Vec<Outline>],
    all: Vec<Edges<'a>>,
    mut solution: Solution,
    has_delay: bool,
) -> (Vec<Edges<'a>>, Solution) {
    let delay_s = solution.delay_s;
    let turned = |((outlines, edges), turn): ((&Vec<Outline>, Edges<'a>), &mut Turn)| {
        if !edges.may_tell_axis() {
            return edges;
        }
        let mut freed = [edges];
        freed[0].axes.push([0.0, 0.0, 1.0]);
        let found = Solution { turns: vec![searched(&freed[0], delay_s).1], delay_s }.refined(&freed, false);
        let about_axis = |solution: &Solution| solution.turns[0][2];
        let parts = parts(std::slice::from_ref(outlines), &freed, &found, false);
        let sigma = deviation(&parts, about_axis).hypot(freed[0].common_deviation(2));
        let [mut edges] = freed;
        let gain = edges.peak(found.turns[0], delay_s).powi(2) - edges.peak(*turn, delay_s).powi(2);
        if gain > SIGNIFICANT_DELAY.powi(2) && about_axis(&found).abs() > MIN_DEVIATIONS * sigma {
            *turn = found.turns[0];
        } else {
            edges.axes.pop();
        }
        edges
    };
    let all: Vec<Edges<'a>> = outlines.iter().zip(all).zip(&mut solution.turns).map(turned).collect();
    let solution = solution.refined(&all, has_delay);
    (all, solution)
}

/// Turns alone, of the edges of some range, about the turn that all edges gave.
pub fn fit_at_range(profiles: &[Profile], range_m: Range<f32>, around: &CameraOffset, delay_s: f32) -> CameraOffset {
    let outlines: Vec<Outline> =
        profiles.iter().filter(|profile| range_m.contains(&profile.range_m)).map(Outline::from).collect();
    let edges = [Edges::new(outlines.iter())];
    let found = Solution { turns: vec![around.turn], delay_s }.refined(&edges, false);
    let peak = edges[0].peak(found.turns[0], delay_s);
    CameraOffset {
        turn: found.turns[0],
        is_turned_about_axis: around.is_turned_about_axis,
        is_across_alone: edges[0].n_across < 2,
        deviation: [0.0; 3],
        n_edges: edges[0].n_edges(),
        peak,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offset::REACH;

    /// A number from 0 to 1 that looks like chance.
    fn chance(seed: usize) -> f32 {
        (((seed as f32 + 1.0) * 12.9898).sin() * 43_758.547).rem_euclid(1.0)
    }

    /// Edges of a camera of 800 steps per rad that runs along them at 10 m/s, 5 to 40 m away, with outlines where a turn and a delay put them
    /// and as many others by chance.
    fn profiles(turn: Turn, delay_s: f32, speed: f32, is_outline: bool) -> Vec<Profile> {
        let profile = |i: usize| {
            let (angle, range_m) = (6.3 * chance(3 * i), 5.0 + 35.0 * chance(3 * i + 1));
            let per_rad = [800.0 * angle.cos(), 800.0 * angle.sin(), 300.0 * (2.0 * chance(7 * i) - 1.0)];
            let per_s = 800.0 * speed / range_m * angle.sin();
            let phase = chance(3 * i + 2);
            let shift = (0..3).map(|axis| per_rad[axis] * turn[axis]).sum::<f32>() + per_s * delay_s - phase;
            let change = |at: usize| {
                let from_outline = (at as f32 - REACH as f32 - shift).abs();
                let outline = if is_outline { (2.0 - from_outline).max(0.0) * 30.0 } else { 0.0 };
                let other = if chance(1000 * i + at) > 0.9 { 40.0 } else { 0.0 };
                (outline + other - 6.0) as i8
            };
            let changes = (0..=2 * REACH).map(change).collect();
            Profile { range_m, gap: 1.0, per_rad, per_s, phase, changes }
        };
        (0..600).map(profile).collect()
    }

    #[test]
    fn a_turn_and_a_delay_are_found_and_told_apart() {
        for (turn, delay_s) in [([0.0035, -0.02, 0.01], 0.0), ([-0.004, 0.001, -0.005], 0.03), ([0.0; 3], -0.1)] {
            let found = fit(&[profiles(turn, delay_s, 10.0, true)]);
            let camera = &found.cameras[0];
            assert!(camera.is_found(), "{found:?}");
            assert_eq!(camera.is_turned_about_axis, turn[2] != 0.0, "{found:?}");
            for axis in 0..3 {
                assert!((camera.turn[axis] - turn[axis]).abs() < 1e-3, "{found:?} instead of {turn:?} and {delay_s}");
            }
            let found_s = found.delay_s.map_or(0.0, |[delay_s, _]| delay_s);
            assert!((found_s - delay_s).abs() < 2e-3, "{found:?} instead of {delay_s}");
            assert_eq!(found.delay_s.is_some(), delay_s != 0.0);
        }
    }

    #[test]
    fn a_delay_is_not_told_by_a_vehicle_that_stands() {
        let cameras = |speed: f32| [0; 4].map(|_| profiles([0.01, 0.0, 0.0], 0.0, speed, true));
        assert!(fit(&cameras(10.0)).tells_delay && !fit(&cameras(0.0)).tells_delay);
        let found = fit(&[profiles([0.01, 0.0, 0.0], 0.05, 0.0, true)]);
        assert!(
            found.delay_s.is_none() && !found.tells_delay && (found.cameras[0].turn[0] - 0.01).abs() < 3e-4,
            "{found:?}"
        );
    }

    #[test]
    fn parts_that_contradict_each_other_find_nothing() {
        let found = CameraOffset {
            turn: [0.04, 0.01, 0.0],
            is_turned_about_axis: false,
            is_across_alone: false,
            deviation: [0.001, 0.001, 0.0],
            n_edges: 800,
            peak: 13.0,
        };
        assert!(found.is_found() && found.exceeds(0.005), "{found:?}");
        let torn = CameraOffset { deviation: [0.009, 0.004, 0.0], ..found };
        assert!(!torn.is_found() && !torn.exceeds(0.005), "{torn:?}");
    }

    #[test]
    fn where_there_are_no_outlines_nothing_is_found() {
        let found = fit(&[profiles([0.0; 3], 0.0, 10.0, false), Vec::new()]);
        assert!(found.cameras.iter().all(|camera| !camera.is_found()), "{found:?}");
    }
}
