//! Fit of rotations and delay to the profiles of a run.
//!
//! The unknowns are one rotation per camera and one delay for all cameras, because one trigger fires them. A rotation
//! moves all edges of a camera equally, at any range. A delay moves near edges more than far ones, edges ahead outward
//! and edges at the side backward. Both are distinguishable if the vehicle moves and the edges are at different ranges.
//! Otherwise the delay is reported as not observable, and the rotations are valid for a delay of zero.

use crate::offset::{CameraOffset, Offset, Rotation};
use crate::outlines::{CameraOutlines, Outline};
use crate::profile::Profile;
use crate::search::{Solution, best_on_grid};
use rayon::prelude::*;
use std::ops::Range;

/// Least increase of the peak for a significant delay or rotation about the optical axis: the squared peak rises by the
/// square of this.
const SIGNIFICANT_GAIN: f32 = 8.0;

/// Consecutive parts of the drive, left out one by one to estimate standard deviations (the jackknife; Efron, "The Jackknife,
/// the Bootstrap and Other Resampling Plans", 1982). Interleaved parts would contain the same outlines and agree on their errors.
const N_PARTS: usize = 8;

/// Smallest rotation about the optical axis, in its standard deviations: a high peak may come from a rotation that is not
/// observable.
const MIN_DEVIATIONS: f32 = 2.0;

/// Standard deviation of the position of one edge, steps. Derived from deviations of the delay: 2 to 12 steps for 0.3 to 2 ms on
/// rigs l3d2 (development seeds 41 and 42) and nuscenes (21 and 22). Many edges share an outline, so it is larger than the
/// deviation of an outline.
const EDGE_STEPS: f32 = 8.0;

/// Error of the delay that all parts of a drive share, steps: errors of delays up to 60 ms are 0.4 ms (nuscenes) and 1.4 ms
/// (l3d2) on these drives.
const COMMON_DELAY_STEPS: f32 = 0.1;

/// Largest standard deviation of an observable delay, s: 10 ms are three of them.
const OBSERVABLE_DELAY_S: f32 = 0.003;

/// Fits rotations and delay to the profiles of each camera.
pub fn fit(cameras: &[Vec<Profile>]) -> Offset {
    let outlines: Vec<Vec<Outline>> =
        cameras.par_iter().map(|profiles| profiles.iter().map(Outline::from).collect()).collect();
    let all: Vec<CameraOutlines<'_>> = outlines.iter().map(|outlines| CameraOutlines::new(outlines.iter())).collect();
    let without_delay = Solution::search(&all, false);
    let with_delay = Solution::search(&all, true).refined(&all, true);
    let without_delay = without_delay.refined(&all, false);
    let gain = with_delay.peak(&all).powi(2) - without_delay.peak(&all).powi(2);
    let has_delay = gain > SIGNIFICANT_GAIN.powi(2);
    let solution = if has_delay { with_delay } else { without_delay };
    let CamerasWithSolution { all, solution } = with_rotations_about_axes(&outlines, all, solution, has_delay);
    let parts = without_each_part(&outlines, &all, &solution, has_delay);
    let camera = |(i, outlines): (usize, &CameraOutlines<'_>)| CameraOffset {
        rotation: solution.rotations[i],
        deviation: [0, 1, 2]
            .map(|axis| deviation(&parts, |part| part.rotations[i][axis]).hypot(outlines.common_deviation(axis))),
        is_rotated_about_axis: outlines.axes.len() > outlines.n_across,
        is_across_alone: outlines.n_across < 2,
        n_edges: outlines.n_edges(),
        peak: outlines.peak(solution.rotations[i], solution.delay_s),
    };
    let n_edges = all.iter().map(CameraOutlines::n_edges).sum::<usize>() as f32;
    let steps_per_s = all.iter().map(CameraOutlines::delay_square).sum::<f32>().sqrt();
    let common_s = COMMON_DELAY_STEPS * n_edges.sqrt() / steps_per_s.max(1e-6);
    Offset {
        is_delay_observable: has_delay || steps_per_s * OBSERVABLE_DELAY_S > EDGE_STEPS,
        delay_s: has_delay.then(|| [solution.delay_s, deviation(&parts, |part| part.delay_s).hypot(common_s)]),
        cameras: all.iter().enumerate().map(camera).collect(),
    }
}

/// The solutions that leave out one part of the drive each.
fn without_each_part(
    outlines: &[Vec<Outline>],
    all: &[CameraOutlines<'_>],
    solution: &Solution,
    has_delay: bool,
) -> Vec<Solution> {
    let without = |part: usize| {
        let rest_of_each = outlines.iter().zip(all).map(|(outlines, camera)| {
            let [begin, end] = [part, part + 1].map(|part| part * outlines.len() / N_PARTS);
            let mut rest = CameraOutlines::new(outlines[..begin].iter().chain(&outlines[end..]));
            rest.axes.clone_from(&camera.axes);
            rest
        });
        let rest: Vec<CameraOutlines<'_>> = rest_of_each.collect();
        solution.clone().refined(&rest, has_delay)
    };
    (0..N_PARTS).into_par_iter().map(without).collect()
}

/// Standard deviation of a value, by the jackknife.
fn deviation(parts: &[Solution], value: impl Fn(&Solution) -> f32) -> f32 {
    let n = N_PARTS as f32;
    let mean = parts.iter().map(&value).sum::<f32>() / n;
    let square: f32 = parts.iter().map(|part| (value(part) - mean).powi(2)).sum();
    (square * (n - 1.0) / n).sqrt()
}

/// Outlines of all cameras, and their rotations.
struct CamerasWithSolution<'a> {
    all: Vec<CameraOutlines<'a>>,
    solution: Solution,
}

/// Adds a rotation about the optical axis for cameras whose peak it raises significantly. For the other cameras, one
/// more unknown would only add noise.
fn with_rotations_about_axes<'a>(
    outlines: &[Vec<Outline>],
    all: Vec<CameraOutlines<'a>>,
    mut solution: Solution,
    has_delay: bool,
) -> CamerasWithSolution<'a> {
    let delay_s = solution.delay_s;
    let fitted = |((outlines, camera), rotation): ((&Vec<Outline>, CameraOutlines<'a>), &mut Rotation)| {
        if !camera.observes_optical_axis() {
            return camera;
        }
        let mut freed = [camera];
        freed[0].axes.push([0.0, 0.0, 1.0]);
        let found =
            Solution { rotations: vec![best_on_grid(&freed[0], delay_s).rotation], delay_s }.refined(&freed, false);
        let about_axis = |solution: &Solution| solution.rotations[0][2];
        let parts = without_each_part(std::slice::from_ref(outlines), &freed, &found, false);
        let sigma = deviation(&parts, about_axis).hypot(freed[0].common_deviation(2));
        let [mut camera] = freed;
        let gain = camera.peak(found.rotations[0], delay_s).powi(2) - camera.peak(*rotation, delay_s).powi(2);
        if gain > SIGNIFICANT_GAIN.powi(2) && about_axis(&found).abs() > MIN_DEVIATIONS * sigma {
            *rotation = found.rotations[0];
        } else {
            camera.axes.pop();
        }
        camera
    };
    let all: Vec<CameraOutlines<'a>> = outlines.iter().zip(all).zip(&mut solution.rotations).map(fitted).collect();
    let solution = solution.refined(&all, has_delay);
    CamerasWithSolution { all, solution }
}

/// Fits the rotation alone to the edges in a span of ranges, starting from the result of all edges.
pub fn fit_at_range(profiles: &[Profile], range_m: Range<f32>, around: &CameraOffset, delay_s: f32) -> CameraOffset {
    let outlines: Vec<Outline> =
        profiles.iter().filter(|profile| range_m.contains(&profile.range_m)).map(Outline::from).collect();
    let camera = [CameraOutlines::new(outlines.iter())];
    let found = Solution { rotations: vec![around.rotation], delay_s }.refined(&camera, false);
    let peak = camera[0].peak(found.rotations[0], delay_s);
    CameraOffset {
        rotation: found.rotations[0],
        is_rotated_about_axis: around.is_rotated_about_axis,
        is_across_alone: camera[0].n_across < 2,
        deviation: [0.0; 3],
        n_edges: camera[0].n_edges(),
        peak,
    }
}

/// Searches the rotation of one camera alone, without a delay and without standard deviations, to compare many
/// hypotheses about a camera.
pub fn fit_rotation(profiles: &[Profile]) -> CameraOffset {
    let outlines: Vec<Outline> = profiles.iter().map(Outline::from).collect();
    let camera = [CameraOutlines::new(outlines.iter())];
    let found = Solution::search(&camera, false).refined(&camera, false);
    CameraOffset {
        rotation: found.rotations[0],
        is_rotated_about_axis: false,
        is_across_alone: camera[0].n_across < 2,
        deviation: [0.0; 3],
        n_edges: camera[0].n_edges(),
        peak: camera[0].peak(found.rotations[0], 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::REACH;
    use random::{mix, unit};

    /// Uniform in `[0, 1)`.
    fn chance(seed: usize) -> f32 {
        unit(mix(seed as u64))
    }

    /// Edges of a camera of 800 steps per rad that passes them at 5 to 40 m, with outlines at the positions of a rotation and a
    /// delay, and as many other changes at random.
    fn profiles(rotation: Rotation, delay_s: f32, speed: f32, is_outline: bool) -> Vec<Profile> {
        let profile = |i: usize| {
            let angle = 6.3 * chance(3 * i);
            let range_m = 5.0 + 35.0 * chance(3 * i + 1);
            let per_rad = [800.0 * angle.cos(), 800.0 * angle.sin(), 300.0 * (2.0 * chance(7 * i) - 1.0)];
            let per_s = 800.0 * speed / range_m * angle.sin();
            let phase = chance(3 * i + 2);
            let shift = (0..3).map(|axis| per_rad[axis] * rotation[axis]).sum::<f32>() + per_s * delay_s - phase;
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
    fn planted_rotation_and_delay_are_estimated() {
        for (rotation, delay_s) in [([0.0035, -0.02, 0.01], 0.0), ([-0.004, 0.001, -0.005], 0.03), ([0.0; 3], -0.1)] {
            let found = fit(&[profiles(rotation, delay_s, 10.0, true)]);
            let camera = &found.cameras[0];
            assert!(camera.is_observable(), "{found:?}");
            assert_eq!(camera.is_rotated_about_axis, rotation[2] != 0.0, "{found:?}");
            for axis in 0..3 {
                assert!(
                    (camera.rotation[axis] - rotation[axis]).abs() < 1e-3,
                    "{found:?} instead of {rotation:?} and {delay_s}"
                );
            }
            let found_s = found.delay_s.map_or(0.0, |[delay_s, _]| delay_s);
            assert!((found_s - delay_s).abs() < 2e-3, "{found:?} instead of {delay_s}");
            assert_eq!(found.delay_s.is_some(), delay_s != 0.0);
        }
    }

    #[test]
    fn rotation_alone_is_that_of_the_whole_fit() {
        let found = fit_rotation(&profiles([0.02, -0.01, 0.0], 0.0, 10.0, true));
        assert!((found.rotation[0] - 0.02).abs() < 1e-3 && (found.rotation[1] + 0.01).abs() < 1e-3, "{found:?}");
        assert!(found.peak > 2.0 * fit_rotation(&profiles([0.0; 3], 0.0, 10.0, false)).peak, "{found:?}");
    }

    #[test]
    fn delay_is_not_observable_at_standstill() {
        let cameras = |speed: f32| [0; 4].map(|_| profiles([0.01, 0.0, 0.0], 0.0, speed, true));
        assert!(fit(&cameras(10.0)).is_delay_observable && !fit(&cameras(0.0)).is_delay_observable);
        let found = fit(&[profiles([0.01, 0.0, 0.0], 0.05, 0.0, true)]);
        assert!(
            found.delay_s.is_none() && !found.is_delay_observable && (found.cameras[0].rotation[0] - 0.01).abs() < 3e-4,
            "{found:?}"
        );
    }

    #[test]
    fn offset_with_large_deviation_is_not_observable() {
        let found = CameraOffset {
            rotation: [0.04, 0.01, 0.0],
            is_rotated_about_axis: false,
            is_across_alone: false,
            deviation: [0.001, 0.001, 0.0],
            n_edges: 800,
            peak: 13.0,
        };
        assert!(found.is_observable() && found.exceeds(0.005), "{found:?}");
        let torn = CameraOffset { deviation: [0.009, 0.004, 0.0], ..found };
        assert!(!torn.is_observable() && !torn.exceeds(0.005), "{torn:?}");
    }

    #[test]
    fn images_without_outlines_give_no_offset() {
        let found = fit(&[profiles([0.0; 3], 0.0, 10.0, false), Vec::new()]);
        let are_observable: Vec<bool> = found.cameras.iter().map(CameraOffset::is_observable).collect();
        assert_eq!(are_observable, [false, false], "{found:?}");
    }
}
