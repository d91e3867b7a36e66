//! Pairs of features of one surface that were seen from different places.

use super::views::View;
use geometry::{Point3, Pose, Vector3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Largest distance of the features of a pair, m; also the side of the cells that are searched.
const REACH_M: f64 = 0.4;
/// Least cosine of the angle between the normals of a pair: 20 degrees.
const MIN_COSINE: f64 = 0.94;
/// The vehicle is at least so far apart, m: one view of a surface gives no pair with the next sweep.
const APART_M: f64 = 6.0;

/// Two features on one surface.
pub struct Pair {
    /// Indices of the features.
    pub target: usize,
    pub source: usize,
    /// Mean normal, in the world.
    pub normal: Vector3<f64>,
    /// Distance of the source from the plane through the target, m.
    pub distance_m: f64,
}

/// A feature in the world.
struct Placed {
    p: Point3<f64>,
    normal: Vector3<f64>,
    vehicle: Vector3<f64>,
    forward: Vector3<f64>,
}

/// The features of each cell: a range of `order`.
struct Cells {
    order: Vec<usize>,
    ranges: HashMap<[i32; 3], std::ops::Range<usize>>,
}

/// For each feature the nearest one in the same direction of travel and the nearest one in the opposite direction.
pub fn pairs(views: &[&View], mounting: &Pose, offsets: &[Vector3<f64>]) -> Vec<Pair> {
    let place = |view: &&View| {
        let world_from_lidar = view.world_from_body * mounting;
        let offset = offsets[view.drive];
        Placed {
            p: world_from_lidar * Point3::from(view.p_in_lidar()) + offset,
            normal: world_from_lidar.rotation * view.normal_in_lidar(),
            vehicle: view.world_from_body.translation.vector,
            forward: view.world_from_body.rotation * Vector3::x(),
        }
    };
    let placed: Vec<Placed> = views.par_iter().map(place).collect();
    let cells = Cells::new(&placed);
    let found = (0..placed.len()).into_par_iter().map(|source| {
        let mut nearest: [Option<Candidate>; 2] = [None, None];
        for target in cells.around(&placed[source].p) {
            let candidate = Candidate::new(&placed, target, source);
            let Some(candidate) = candidate else { continue };
            let best = &mut nearest[usize::from(candidate.is_opposite)];
            if best.as_ref().is_none_or(|best| candidate.within_m < best.within_m) {
                *best = Some(candidate);
            }
        }
        nearest.map(|candidate| candidate.map(|candidate| candidate.pair(&placed, source)))
    });
    found.collect::<Vec<_>>().into_iter().flatten().flatten().collect()
}

/// A feature that may be paired.
struct Candidate {
    target: usize,
    /// Distance within the surface, m. The distance from the surface is the residual and must not select the pair.
    within_m: f64,
    is_opposite: bool,
}

impl Candidate {
    fn new(placed: &[Placed], target: usize, source: usize) -> Option<Self> {
        let [a, b] = [&placed[target], &placed[source]];
        let off = b.p - a.p;
        let is_apart = (a.vehicle - b.vehicle).norm() > APART_M || a.forward.dot(&b.forward) < 0.0;
        let is_pair = off.norm() < REACH_M && a.normal.dot(&b.normal) > MIN_COSINE && is_apart;
        let within_m = (off - a.normal * a.normal.dot(&off)).norm();
        is_pair.then(|| Self { target, within_m, is_opposite: a.forward.dot(&b.forward) < 0.0 })
    }

    fn pair(self, placed: &[Placed], source: usize) -> Pair {
        let [a, b] = [&placed[self.target], &placed[source]];
        let normal = (a.normal + b.normal).normalize();
        Pair { target: self.target, source, normal, distance_m: normal.dot(&(b.p - a.p)) }
    }
}

impl Cells {
    fn new(placed: &[Placed]) -> Self {
        let mut order: Vec<usize> = (0..placed.len()).collect();
        order.sort_by_key(|k| cell(&placed[*k].p));
        let mut ranges = HashMap::new();
        let mut first = 0;
        for part in order.chunk_by(|a, b| cell(&placed[*a].p) == cell(&placed[*b].p)) {
            ranges.insert(cell(&placed[part[0]].p), first..first + part.len());
            first += part.len();
        }
        Self { order, ranges }
    }

    /// The features in the cell of a position and in the cells next to it.
    fn around(&self, p: &Point3<f64>) -> impl Iterator<Item = usize> + '_ {
        let [x, y, z] = cell(p);
        let steps = (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [i, j, k])));
        let ranges = steps.filter_map(move |[i, j, k]| self.ranges.get(&[x + i, y + j, z + k]));
        ranges.flat_map(|range| self.order[range.clone()].iter().copied())
    }
}

fn cell(p: &Point3<f64>) -> [i32; 3] {
    [p.x, p.y, p.z].map(|value| (value / REACH_M).floor() as i32)
}
