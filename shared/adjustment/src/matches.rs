//! Relative poses of submaps of different drives, from their surfaces.

use crate::drives::Submaps;
use geometry::{Point3, Pose};
use georeference::{FitFloor, RelativePose, SurfacePoint, refine, surface_map};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Two submaps whose middles are this far apart show the same street, m: the length of a submap.
const NEAR_M: f64 = 20.0;
/// Largest number of submaps of another drive that a submap is matched with: one behind and one ahead.
const MAX_PARTNERS: usize = 2;
/// Least share of surfaces that coincide with surfaces.
const MIN_MATCHED: f64 = 0.25;
/// Least standard deviations of a match: what deskewing, calibration and thinning leave between two passes.
const FLOOR: FitFloor = FitFloor { m: 0.01, rad: 0.0003 };

/// Two submaps of different drives, and their measured relative pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Match {
    /// Relative pose; `target` and `source` are numbers of submaps of the survey.
    pub relative: RelativePose,
    /// Share of surfaces that coincide with surfaces.
    pub matched: f64,
    /// Root mean square distance of the surfaces, m.
    pub rms_m: f64,
}

impl Match {
    /// Standard deviations that the match states for its position, east, north and up, m. `None` if an axis is undetermined.
    pub fn sigma_m(&self, poses: &[Pose]) -> Option<[f64; 3]> {
        let covariance = self.relative.information.try_inverse()?;
        let axes = poses[self.relative.target].rotation.to_rotation_matrix();
        let position = axes.matrix() * covariance.fixed_view::<3, 3>(0, 0) * axes.matrix().transpose();
        Some([0, 1, 2].map(|axis| position[(axis, axis)].max(0.0).sqrt()))
    }
}

/// Matches all submaps that are near each other for the current poses, which must be accurate within some decimetres.
pub fn fine_matches(submaps: &Submaps, poses: &[Pose]) -> Vec<Match> {
    let pairs = near_pairs(submaps, &submaps.centers(poses));
    let matched = |&(target, source): &(usize, usize)| {
        let guess = poses[target].inv_mul(&poses[source]);
        let surfaces = |k: usize| -> Vec<SurfacePoint> { submaps.all[k].keyframe.surfaces().collect() };
        let fit = refine(&surface_map(&surfaces(target)), &surfaces(source), &guess, FLOOR)?;
        let relative =
            RelativePose { target, source, target_from_source: fit.target_from_source, information: fit.information };
        (fit.matched >= MIN_MATCHED).then_some(Match { relative, matched: fit.matched, rms_m: fit.rms_m })
    };
    pairs.par_iter().filter_map(matched).collect()
}

/// Each submap with the nearest submaps of each earlier drive.
fn near_pairs(submaps: &Submaps, centers: &[Point3<f64>]) -> Vec<(usize, usize)> {
    let cell = |k: usize| centers[k].xy().coords.map(|value| (value / NEAR_M).floor() as i64);
    let mut by_cell: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
    let mut pairs = Vec::new();
    for source in 0..submaps.all.len() {
        let at = cell(source);
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (at.x + i, at.y + j)));
        let distance = |k: usize| (centers[k] - centers[source]).xy().norm();
        let mut near: Vec<usize> = around.filter_map(|cell| by_cell.get(&cell)).flatten().copied().collect();
        near.retain(|k| submaps.all[*k].drive != submaps.all[source].drive && distance(*k) < NEAR_M);
        near.sort_by(|a, b| {
            let drive = |k: usize| submaps.all[k].drive;
            drive(*a).cmp(&drive(*b)).then(distance(*a).total_cmp(&distance(*b)))
        });
        for of_drive in near.chunk_by(|a, b| submaps.all[*a].drive == submaps.all[*b].drive) {
            pairs.extend(of_drive.iter().take(MAX_PARTNERS).map(|target| (*target, source)));
        }
        by_cell.entry((at.x, at.y)).or_default().push(source);
    }
    pairs
}

/// Distance between the positions of the source by the match and by the poses of both submaps, in the survey frame, m.
pub fn disagreement(relative: &RelativePose, poses: &[Pose]) -> Vector3<f64> {
    let by_match = poses[relative.target] * relative.target_from_source;
    by_match.translation.vector - poses[relative.source].translation.vector
}
