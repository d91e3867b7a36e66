//! Poses far from a prediction, by the overlap of upright surfaces in a top view.
//!
//! A match finds the map only within its search radius of half a metre. A sweep after a fast turn, or a second after the last one,
//! lies beyond it. In a top view, facades, trunks and hedges of the sweep lie on the same ones in the map at the correct heading and
//! position. All headings and positions within reach are compared, and the best ones are candidates for a match.

use crate::{Feature, MapPoint, SweepMotion};
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// Side of a cell, m: the search radius of a match.
const CELL_M: f64 = 0.5;
/// Surfaces up to this distance are compared, m: the range of dense returns.
const RANGE_M: f64 = 40.0;
/// Directions of normals; a surface also counts in both adjacent ones.
const N_SECTORS: usize = 8;
/// Largest vertical component of the normal of an upright surface: 30 degrees from vertical.
pub(super) const MAX_NORMAL_Z: f32 = 0.5;
/// Values of a cell with a surface and of the cells around it.
const VALUE_INSIDE: u8 = 3;
const VALUE_AROUND: u8 = 1;
/// Samples of a sweep: 600 of a few thousand determine the maximum as well as all.
const MAX_SAMPLES: usize = 600;
/// Fewer samples determine neither heading nor position.
const MIN_SAMPLES: usize = 30;
/// Steps of the comparison: half of a step moves a surface at 15 m by less than the cells around it.
const TURN_STEP_RAD: f64 = 0.0524;
const SHIFT_STEP_M: f64 = 1.0;
/// Steps of the refinement around a maximum, three to either side.
const FINE_TURN_STEP_RAD: f64 = TURN_STEP_RAD / 4.0;
const FINE_SHIFT_STEP_M: f64 = SHIFT_STEP_M / 4.0;
const N_FINE_STEPS: i32 = 3;
/// Candidates are farther apart than this in heading or in position.
const SEPARATE_RAD: f64 = 2.5 * TURN_STEP_RAD;
const SEPARATE_M: f64 = 1.8;

/// Poses to compare: all within these distances of one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SearchExtent {
    /// Largest turn about the vertical, rad.
    pub turn_rad: f64,
    /// Largest horizontal shift, m.
    pub shift_m: f64,
}

/// A compared pose, relative to the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Offset {
    turn_rad: f64,
    shift_m: [f64; 2],
}

impl Offset {
    fn is_separate(&self, other: &Self) -> bool {
        let [x, y] = [0, 1].map(|axis| self.shift_m[axis] - other.shift_m[axis]);
        (self.turn_rad - other.turn_rad).abs() > SEPARATE_RAD || x.hypot(y) > SEPARATE_M
    }
}

/// The `n` poses within `extent` of the middle of `motion` at which the upright features cover most of the upright map points, best
/// one first. Empty if the sweep has too few upright features.
pub(super) fn poses_by_top_view(
    features: &[Feature],
    map: impl Iterator<Item = MapPoint>,
    motion: &SweepMotion,
    extent: &SearchExtent,
    n: usize,
) -> Vec<Pose> {
    let samples = upright_samples(features, motion);
    if samples.len() < MIN_SAMPLES {
        return Vec::new();
    }
    let view = TopView::new(map, &motion.mid.translation.vector, extent.shift_m);
    let n_turns = (extent.turn_rad / TURN_STEP_RAD).ceil() as i32;
    let n_shifts = (extent.shift_m / SHIFT_STEP_M).ceil() as i32;
    let coarse = Steps { turn_rad: TURN_STEP_RAD, shift_m: SHIFT_STEP_M, n_turns, n_shifts };
    let mut scored = view.scores(&samples, &Offset { turn_rad: 0.0, shift_m: [0.0; 2] }, &coarse);
    scored.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    let mut best: Vec<Offset> = Vec::new();
    for (_, offset) in scored {
        if best.len() == n {
            break;
        }
        if best.iter().all(|other| offset.is_separate(other)) {
            best.push(offset);
        }
    }
    let fine = Steps {
        turn_rad: FINE_TURN_STEP_RAD,
        shift_m: FINE_SHIFT_STEP_M,
        n_turns: N_FINE_STEPS,
        n_shifts: N_FINE_STEPS,
    };
    let mut refined: Vec<(u32, Offset)> = best
        .iter()
        .filter_map(|offset| view.scores(&samples, offset, &fine).into_iter().max_by_key(|(score, _)| *score))
        .collect();
    refined.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    refined.iter().map(|(_, offset)| moved(&motion.mid, offset)).collect()
}

fn moved(pose: &Pose, Offset { turn_rad, shift_m: [x, y] }: &Offset) -> Pose {
    let position = pose.translation.vector + Vector3::new(*x, *y, 0.0);
    Isometry3::from_parts(
        position.into(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *turn_rad) * pose.rotation,
    )
}

/// An upright surface of a sweep: position relative to the sensor, and direction of the normal, odom axes.
#[derive(Clone, Copy, Debug)]
struct Sample {
    position: [f64; 2],
    normal_rad: f64,
}

/// Upright features, one per cell and sector, evenly thinned.
fn upright_samples(features: &[Feature], motion: &SweepMotion) -> Vec<Sample> {
    let mid = *motion.mid.rotation.to_rotation_matrix().matrix();
    let mut met = BTreeSet::new();
    let sample = |feature: &Feature| {
        let share = f64::from(feature.share);
        let normal = motion.rotated(&mid, &feature.normal, share);
        let arm = motion.rotated(&mid, &feature.position, share) + motion.translation * share;
        let is_used = normal.z.abs() < f64::from(MAX_NORMAL_Z) && arm.xy().norm() < RANGE_M;
        let sample = Sample { position: arm.xy().into(), normal_rad: normal.y.atan2(normal.x) };
        let cell = sample.position.map(|v| (v / CELL_M).floor() as i32);
        (is_used && met.insert((cell, sector(sample.normal_rad)))).then_some(sample)
    };
    let samples: Vec<Sample> = features.iter().filter_map(sample).collect();
    let step = samples.len().div_ceil(MAX_SAMPLES).max(1);
    samples.into_iter().step_by(step).collect()
}

fn sector(normal_rad: f64) -> usize {
    (normal_rad / TAU * N_SECTORS as f64).round().rem_euclid(N_SECTORS as f64) as usize % N_SECTORS
}

/// Compared offsets around one.
struct Steps {
    turn_rad: f64,
    shift_m: f64,
    /// Steps to either side.
    n_turns: i32,
    n_shifts: i32,
}

/// Values of the cells around a position, by sector.
struct TopView {
    center: [f64; 2],
    /// Cells from the center to the edge.
    half: i32,
    values: Vec<u8>,
}

impl TopView {
    fn new(map: impl Iterator<Item = MapPoint>, center: &Vector3<f64>, shift_m: f64) -> Self {
        let half = ((RANGE_M + shift_m) / CELL_M).ceil() as i32 + 4;
        let side = 2 * half as usize;
        let mut view = Self { center: center.xy().into(), half, values: vec![0; side * side * N_SECTORS] };
        for point in map.filter(|point| point.normal[2].abs() < MAX_NORMAL_Z) {
            let [nx, ny, _] = point.normal.map(f64::from);
            let offset = [0, 1].map(|axis| point.position[axis] - view.center[axis]);
            view.add(offset, sector(ny.atan2(nx)));
        }
        view
    }

    fn add(&mut self, offset: [f64; 2], sector: usize) {
        let [x, y] = offset.map(|v| (v / CELL_M).floor() as i32);
        for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
            let Some(at) = self.at([x + dx, y + dy]) else { continue };
            let value = if (dx, dy) == (0, 0) { VALUE_INSIDE } else { VALUE_AROUND };
            for turn in [N_SECTORS - 1, 0, 1] {
                let cell = &mut self.values[at + (sector + turn) % N_SECTORS];
                *cell = value.max(*cell);
            }
        }
    }

    /// Index of the first sector of a cell; `None` outside.
    fn at(&self, cell: [i32; 2]) -> Option<usize> {
        let [x, y] = cell.map(|v| v + self.half);
        let side = 2 * self.half;
        let is_inside = (0..side).contains(&x) && (0..side).contains(&y);
        is_inside.then(|| (y * side + x) as usize * N_SECTORS)
    }

    /// Scores of the offsets around one: sums of the values under the samples.
    fn scores(&self, samples: &[Sample], around: &Offset, steps: &Steps) -> Vec<(u32, Offset)> {
        let mut scores = Vec::new();
        for turn in -steps.n_turns..=steps.n_turns {
            let turn_rad = around.turn_rad + f64::from(turn) * steps.turn_rad;
            let (sin, cos) = turn_rad.sin_cos();
            let turned = |Sample { position: [x, y], normal_rad }: &Sample| {
                ([cos * x - sin * y, sin * x + cos * y], sector(normal_rad + turn_rad))
            };
            let turned: Vec<([f64; 2], usize)> = samples.iter().map(turned).collect();
            for (x, y) in
                (-steps.n_shifts..=steps.n_shifts).flat_map(|x| (-steps.n_shifts..=steps.n_shifts).map(move |y| (x, y)))
            {
                let shift_m = [
                    around.shift_m[0] + f64::from(x) * steps.shift_m,
                    around.shift_m[1] + f64::from(y) * steps.shift_m,
                ];
                let value = |(position, sector): &([f64; 2], usize)| {
                    let cell = [0, 1].map(|axis| ((position[axis] + shift_m[axis]) / CELL_M).floor() as i32);
                    self.at(cell).map_or(0, |at| u32::from(self.values[at + sector]))
                };
                scores.push((turned.iter().map(value).sum(), Offset { turn_rad, shift_m }));
            }
        }
        scores
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Upright surfaces around the origin: two facades with gaps, and trunks, seen from inside.
    fn street() -> Vec<Feature> {
        let feature = |x: f32, y: f32, normal: [f32; 3]| Feature {
            position: [x, y, 0.0],
            normal,
            share: 0.0,
            planarity: 0.9,
            roughness_m: 0.01,
            is_rough: false,
            lever: 0.0,
            row: 0,
            point_idx: 0,
        };
        let along = (-120..120).map(|step| 0.25 * step as f32);
        let facades = along.flat_map(|x| {
            let right = ((x + 40.0) % 11.0 > 2.0).then(|| feature(x, -6.0, [0.0, 1.0, 0.0]));
            let left = ((x + 40.0) % 17.0 > 4.0).then(|| feature(x, 8.0, [0.0, -1.0, 0.0]));
            right.into_iter().chain(left)
        });
        let ends = (0..14).map(|step| feature(25.0, step as f32 - 6.0, [-1.0, 0.0, 0.0]));
        facades.chain(ends).collect()
    }

    fn map() -> impl Iterator<Item = MapPoint> {
        street().into_iter().map(|feature| MapPoint {
            position: feature.position.map(f64::from),
            normal: feature.normal,
            lever: 0.0,
            turn_lever: 0.0,
            batch: 0,
        })
    }

    #[test]
    fn turn_of_40_degrees_and_shift_of_3_m_are_among_the_candidates() {
        let extent = SearchExtent { turn_rad: 0.9, shift_m: 4.0 };
        let predicted = Isometry3::new(Vector3::new(-3.0, 1.0, 0.0), Vector3::z() * 0.7);
        let found = poses_by_top_view(&street(), map(), &SweepMotion::still(predicted), &extent, 4);
        assert!(!found.is_empty() && found.len() <= 4);
        let is_near = |pose: &Pose| pose.translation.vector.norm() < 0.5 && pose.rotation.angle() < 0.05;
        assert!(is_near(&found[0]), "{found:?}");
    }

    #[test]
    fn sweep_with_few_upright_features_has_no_candidates() {
        let extent = SearchExtent { turn_rad: 0.9, shift_m: 4.0 };
        let few = &street()[..MIN_SAMPLES - 1];
        assert!(poses_by_top_view(few, map(), &SweepMotion::still(Pose::identity()), &extent, 4).is_empty());
    }
}
