//! Where drives meet, although their receivers are metres apart.
//!
//! Along a street one place looks like the next: a single submap matches its surroundings at many offsets. Over a stretch of some
//! hundred metres, only the true offset brings walls, gaps, posts and trunks together. So stretches are searched, not submaps: the
//! columns of a stretch are moved over the columns of another drive, horizontally and about the vertical. The heights follow from
//! the ground.

use crate::drives::{Submap, Submaps};
use crate::ground::Ground;
use geometry::{Isometry3, Point3, Pose, Vector3};
use georeference::{FitFloor, RelativePose, SurfacePoint, refine, surface_map};
use nalgebra::{Isometry2, Point2, Vector2};
use rayon::prelude::*;

/// Number of submaps of a stretch: 200 m.
const STRETCH: usize = 10;
/// Search radius, m, in addition to three stated deviations of both drives; and its largest value.
const SEARCH_M: f64 = 10.0;
const MAX_SEARCH_M: f64 = 60.0;
/// Search range of the heading, rad, in addition to three stated deviations of both drives; and its largest value.
const SEARCH_RAD: f64 = 0.01;
const MAX_SEARCH_RAD: f64 = 0.07;
/// Submaps show columns up to this distance from their middle, m.
const REACH_M: f64 = 40.0;
/// Cells and steps of the first search, and of the second one around its best places. The rotation moves the ends of a stretch of
/// 200 m by about one step.
const COARSE: Grid = Grid { cell_m: 1.0, step_rad: 0.01 };
const FINE: Grid = Grid { cell_m: 0.25, step_rad: 0.0025 };
/// Best places of the first search that the second one refines.
const CANDIDATES: usize = 8;
/// Columns of a stretch that are compared.
const MAX_COLUMNS: usize = 3000;
/// Least share of the columns of a stretch that fall on columns.
const MIN_SHARE: f64 = 0.2;
/// Least share of surfaces that coincide with surfaces.
const MIN_MATCHED: f64 = 0.2;

/// A grid of the search.
#[derive(Clone, Copy)]
struct Grid {
    cell_m: f64,
    step_rad: f64,
}

/// A motion of a stretch: about its middle, then by a translation, and the share of columns that fall on columns.
#[derive(Clone, Copy, Debug)]
struct Offset {
    rad: f64,
    translation: Vector2<f64>,
    score: f64,
}

/// Columns of a drive by cell. A cell counts fully, the cells next to it half.
struct ColumnMap {
    cell_m: f64,
    low: Vector2<i64>,
    size: Vector2<i64>,
    weights: Vec<u8>,
}

/// A search range.
struct Search {
    m: f64,
    rad: f64,
}

/// Finds relative poses of submaps of different drives, within a decimetre. Each drive is compared with all earlier ones.
pub fn meetings(submaps: &Submaps) -> Vec<RelativePose> {
    let n = submaps.drives.len();
    let numbers = |drive: usize| (0..submaps.all.len()).filter(|k| submaps.all[*k].drive == drive).collect();
    let by_drive: Vec<Vec<usize>> = (0..n).map(numbers).collect();
    let pairs = (0..n).flat_map(|later| (0..later).map(move |earlier| (earlier, later)));
    let stretches =
        pairs.flat_map(|(earlier, later)| by_drive[later].chunks(STRETCH).map(move |stretch| (earlier, stretch)));
    let stretches: Vec<(usize, &[usize])> = stretches.collect();
    let found = stretches.par_iter().map(|(earlier, stretch)| stretch_meetings(submaps, &by_drive[*earlier], stretch));
    found.collect::<Vec<_>>().concat()
}

/// Relative poses between the submaps of a stretch and the submaps of another drive.
fn stretch_meetings(submaps: &Submaps, targets: &[usize], stretch: &[usize]) -> Vec<RelativePose> {
    let center = |k: usize| submaps.all[k].keyframe.p_in_odom.xy();
    let middle = center(stretch[stretch.len() / 2]);
    let search = Search::new(submaps, targets, stretch);
    let radius_m = stretch.iter().map(|k| (center(*k) - middle).norm()).fold(0.0, f64::max) + REACH_M + search.m;
    let near: Vec<usize> = targets.iter().copied().filter(|k| (center(*k) - middle).norm() < radius_m).collect();
    if near.is_empty() {
        return Vec::new();
    }
    let Some(offset) = best_offset(&columns(submaps, &near), &columns(submaps, stretch), middle, &search) else {
        return Vec::new();
    };
    let survey_from_stretch = offset.motion(middle);
    stretch.iter().filter_map(|source| meeting(submaps, &near, *source, &survey_from_stretch)).collect()
}

impl Search {
    /// Three of the largest stated deviations of both drives.
    fn new(submaps: &Submaps, targets: &[usize], stretch: &[usize]) -> Self {
        let largest = |sigma: fn(&Submap) -> f64| {
            [targets, stretch]
                .map(|numbers| numbers.iter().map(|k| sigma(&submaps.all[*k])).fold(0.0, f64::max))
                .into_iter()
                .fold(0.0, f64::hypot)
        };
        let m = largest(|submap| submap.sigma_m[0].hypot(submap.sigma_m[1]));
        let rad = largest(|submap| submap.sigma_rad[2]);
        Self { m: (SEARCH_M + 3.0 * m).min(MAX_SEARCH_M), rad: (SEARCH_RAD + 3.0 * rad).min(MAX_SEARCH_RAD) }
    }
}

/// Columns of submaps in the survey.
fn columns(submaps: &Submaps, numbers: &[usize]) -> Vec<Point2<f64>> {
    let submaps = numbers.iter().map(|k| &submaps.all[*k]);
    let of_submap = |submap: &Submap| -> Vec<Point2<f64>> {
        submap.columns.iter().map(|p| (submap.survey_from_submap * Point3::new(p.x, p.y, 0.0)).xy()).collect()
    };
    submaps.flat_map(of_submap).collect()
}

impl Offset {
    /// The motion in the plane as a pose.
    fn motion(&self, middle: Point2<f64>) -> Pose {
        let plane = self.in_plane(middle);
        Isometry3::new(
            Vector3::new(plane.translation.x, plane.translation.y, 0.0),
            Vector3::z() * plane.rotation.angle(),
        )
    }
    fn in_plane(&self, middle: Point2<f64>) -> Isometry2<f64> {
        let about = Isometry2::new(middle.coords + self.translation, self.rad);
        about * Isometry2::translation(-middle.x, -middle.y)
    }
}

/// The motion that brings most columns of a stretch onto columns of another drive.
fn best_offset(
    targets: &[Point2<f64>],
    stretch: &[Point2<f64>],
    middle: Point2<f64>,
    search: &Search,
) -> Option<Offset> {
    let step = stretch.len().div_ceil(MAX_COLUMNS).max(1);
    let stretch: Vec<Point2<f64>> = stretch.iter().copied().step_by(step).collect();
    let mut coarse: Vec<Offset> = Vec::new();
    let map = ColumnMap::new(targets, COARSE.cell_m)?;
    for rad in around(0.0, search.rad, COARSE.step_rad) {
        coarse.extend(map.scores(&stretch, middle, rad, Vector2::zeros(), search.m));
    }
    coarse.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut candidates: Vec<Offset> = Vec::new();
    for offset in coarse {
        let is_new = |other: &Offset| (other.translation - offset.translation).norm() > 2.0 * COARSE.cell_m;
        if candidates.len() < CANDIDATES && candidates.iter().all(is_new) {
            candidates.push(offset);
        }
    }
    let map = ColumnMap::new(targets, FINE.cell_m)?;
    let refined = candidates.into_iter().flat_map(|candidate| {
        let turns = around(candidate.rad, COARSE.step_rad, FINE.step_rad);
        turns
            .flat_map(|rad| map.scores(&stretch, middle, rad, candidate.translation, COARSE.cell_m))
            .collect::<Vec<_>>()
    });
    refined.max_by(|a, b| a.score.total_cmp(&b.score)).filter(|best| best.score >= MIN_SHARE)
}

/// Numbers from `middle - range` to `middle + range`.
fn around(middle: f64, range: f64, step: f64) -> impl Iterator<Item = f64> {
    let n = (range / step).ceil() as i32;
    (-n..=n).map(move |k| middle + f64::from(k) * step)
}

impl ColumnMap {
    /// The map of columns; `None` without columns.
    fn new(columns: &[Point2<f64>], cell_m: f64) -> Option<Self> {
        let cell = |p: &Point2<f64>| p.coords.map(|value| (value / cell_m).floor() as i64);
        let cells = columns.iter().map(cell);
        let [low, high] = cells.clone().map(|cell| [cell; 2]).reduce(|[a, b], [c, d]| [a.inf(&c), b.sup(&d)])?;
        let low = low.add_scalar(-1);
        let size = (high - low).add_scalar(2);
        let mut map = Self { cell_m, low, size, weights: vec![0; (size.x * size.y) as usize] };
        for cell in cells {
            for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
                let weight = if (i, j) == (0, 0) { 2 } else { 1 };
                if let Some(at) = map.index(cell + Vector2::new(i, j)) {
                    map.weights[at] = map.weights[at].max(weight);
                }
            }
        }
        Some(map)
    }

    fn index(&self, cell: Vector2<i64>) -> Option<usize> {
        let at = cell - self.low;
        let inside = at.x >= 0 && at.y >= 0 && at.x < self.size.x && at.y < self.size.y;
        inside.then(|| (at.y * self.size.x + at.x) as usize)
    }

    /// The score of each translation up to `range_m` around `first`, for columns turned by `rad` about `middle`.
    fn scores(
        &self,
        columns: &[Point2<f64>],
        middle: Point2<f64>,
        rad: f64,
        first: Vector2<f64>,
        range_m: f64,
    ) -> Vec<Offset> {
        let turned = Offset { rad, translation: first, score: 0.0 }.in_plane(middle);
        let cells: Vec<Vector2<i64>> =
            columns.iter().map(|p| (turned * p).coords.map(|value| (value / self.cell_m).floor() as i64)).collect();
        let n = (range_m / self.cell_m).ceil() as i64;
        let shifts = (-n..=n).flat_map(|i| (-n..=n).map(move |j| Vector2::new(i, j)));
        let score = |shift: Vector2<i64>| {
            let weights =
                cells.iter().filter_map(|cell| self.index(cell + shift)).map(|at| u32::from(self.weights[at]));
            let translation = first + shift.map(|cells| cells as f64 * self.cell_m);
            Offset { rad, translation, score: f64::from(weights.sum::<u32>()) / (2.0 * cells.len() as f64) }
        };
        shifts.map(score).collect()
    }
}

/// The relative pose of a submap and the nearest one of another drive, once its stretch is moved.
fn meeting(submaps: &Submaps, targets: &[usize], source: usize, survey_from_stretch: &Pose) -> Option<RelativePose> {
    let center = survey_from_stretch * submaps.all[source].keyframe.p_in_odom;
    let distance = |k: usize| (submaps.all[k].keyframe.p_in_odom - center).xy().norm();
    let target = targets.iter().copied().min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
    let moved = survey_from_stretch * submaps.all[source].survey_from_submap;
    let surfaces = |k: usize| -> Vec<SurfacePoint> { submaps.all[k].keyframe.surfaces().collect() };
    let [target_surfaces, source_surfaces] = [surfaces(target), surfaces(source)];
    let target_pose = submaps.all[target].survey_from_submap;
    let up_m = Ground::new(&target_surfaces, &target_pose).median_above(&Ground::new(&source_surfaces, &moved))?;
    let guess = target_pose.inv_mul(&(Isometry3::translation(0.0, 0.0, up_m) * moved));
    let fit = refine(&surface_map(&target_surfaces), &source_surfaces, &guess, FitFloor::LOOP)?;
    (fit.matched >= MIN_MATCHED).then_some(RelativePose {
        target,
        source,
        target_from_source: fit.target_from_source,
        information: fit.information,
    })
}
