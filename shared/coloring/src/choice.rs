//! Choice of exposure: among the exposures that show a point, the one with the smallest expected position error of the
//! color.

use crate::candidates::{AgeLimits, Candidates};
use crate::chunk::{CHUNK, Chunk, Lanes, gap, seconds};
use crate::exposure::PosedExposure;
use crate::projection::Projected;
use crate::visibility::{CellGrid, NO_CELL};
use pulp::{Arch, NullaryFnOnce};

/// Drift between the poses of an exposure and a shot, m per second between them: half a percent of 10 m/s.
const DRIFT_M_PER_S: f32 = 0.05;

/// Extra cost of an exposure before the first or after the last shot of the submap, m: objects that passed the camera
/// then are in another submap and cannot occlude here.
const OUTSIDE_SUBMAP_M: f32 = 0.05;

/// Error of mounting and lens in the middle of an image, rad. It doubles towards the border.
const POINTING_RAD: f32 = 0.001;

/// The exposures chosen for the points of a chunk, with reusable buffers.
#[derive(Debug, Default)]
pub struct Choices {
    projected: Projected,
    offer: Offer,
    best: Best,
    /// Number of points with an entry in `best`; 0 if no exposure may see the chunk.
    n_points: usize,
}

/// Costs and cells of the exposure under consideration, for each point.
#[derive(Debug)]
struct Offer {
    /// Expected position error of the color, m.
    costs: Lanes<f32>,
    /// Cell of the visibility map; [`NO_CELL`] if the exposure does not show the point or is not better than the best.
    cells: Lanes<u32>,
    max_range_m: Lanes<f32>,
}

impl Default for Offer {
    fn default() -> Self {
        Self { costs: [0.0; CHUNK], cells: [0; CHUNK], max_range_m: [0.0; CHUNK] }
    }
}

/// The best exposure so far, for each point.
#[derive(Debug)]
struct Best {
    costs: Lanes<f32>,
    exposures: Lanes<u32>,
    u: Lanes<f32>,
    v: Lanes<f32>,
}

impl Default for Best {
    fn default() -> Self {
        Self { costs: [f32::INFINITY; CHUNK], exposures: [NO_EXPOSURE; CHUNK], u: [0.0; CHUNK], v: [0.0; CHUNK] }
    }
}

/// Index used for a point that no exposure shows.
pub const NO_EXPOSURE: u32 = u32::MAX;

/// The exposure chosen for a point.
#[derive(Clone, Copy, Debug)]
pub struct PointChoice {
    /// Index of the point in the chunk.
    pub i: usize,
    /// Index of the exposure.
    pub exposure: usize,
    /// The pixel that shows the point.
    pub pixel: [f32; 2],
}

/// An exposure that shows a point.
#[derive(Clone, Copy, Debug)]
pub struct ShownPoint {
    /// Index of the exposure.
    pub exposure: usize,
    /// The pixel that shows the point.
    pub pixel: [f32; 2],
}

impl Choices {
    /// A choice for every point that some exposure shows.
    pub fn chosen(&self) -> impl Iterator<Item = PointChoice> {
        let Best { exposures, u, v, .. } = &self.best;
        let indices = (0..self.n_points).filter(|i| exposures[*i] != NO_EXPOSURE);
        indices.map(|i| PointChoice { i, exposure: exposures[i] as usize, pixel: [u[i], v[i]] })
    }

    /// The exposure with the smallest expected error among those that show point `i` of the chunk and are `good` at its
    /// pixel.
    pub fn best_where(
        i: usize,
        chunk: &Chunk,
        candidates: &Candidates<'_>,
        good: impl Fn(usize, [f32; 2]) -> bool,
    ) -> Option<ShownPoint> {
        let error_m = |exposure: &PosedExposure<'_>| {
            let time = seconds(exposure.stamp, candidates.points.origin);
            let p = [chunk.x[i], chunk.y[i], chunk.z[i]];
            let range_m = distance_m(&exposure.position, &[p, p]);
            outside_submap_m(candidates, time) + DRIFT_M_PER_S * (chunk.times[i] - time).abs() + POINTING_RAD * range_m
        };
        let all = 0..candidates.exposures.len();
        let visible = all
            .filter_map(|exposure| Some(ShownPoint { exposure, pixel: candidates.visible_pixel(exposure, chunk, i)? }));
        let good = visible.filter(|shown| good(shown.exposure, shown.pixel));
        let error_of = |shown: &ShownPoint| error_m(&candidates.exposures[shown.exposure]);
        good.min_by(|a, b| error_of(a).total_cmp(&error_of(b)))
    }

    /// Chooses an exposure for every point of a chunk. Of two equally good exposures, the first in the list is chosen. A
    /// point of an unknown sweep has no time and gets no exposure.
    pub fn choose(&mut self, chunk: &Chunk, candidates: &Candidates<'_>) {
        let order = by_least_cost(candidates, chunk);
        self.n_points = if order.is_empty() { 0 } else { chunk.n_points };
        if order.is_empty() {
            return;
        }
        self.best.exposures.fill(NO_EXPOSURE);
        self.best.costs.fill(f32::INFINITY);
        for OrderedExposure { index, least_m } in order {
            if self.best.costs.iter().take(self.n_points).all(|cost| *cost < least_m) {
                break;
            }
            self.offer(index, chunk, candidates);
        }
    }

    /// Assigns an exposure to the points that it shows and that have no better one.
    fn offer(&mut self, index: u32, chunk: &Chunk, candidates: &Candidates<'_>) {
        let exposure = &candidates.exposures[index as usize];
        let visibility = &candidates.visibility[index as usize];
        let Self { projected, offer, best, .. } = self;
        projected.fill(chunk, &exposure.camera_from_submap, exposure.lens);
        let time = seconds(exposure.stamp, candidates.points.origin);
        let extra_m = outside_submap_m(candidates, time);
        let is_offered = Arch::new().dispatch(Weigh {
            index,
            time,
            extra_m,
            exposure: *exposure,
            grid: visibility.grid,
            limits: candidates.limits,
            chunk,
            projected,
            best,
            offer,
        });
        if is_offered {
            for (max_range_m, cell) in offer.max_range_m.iter_mut().zip(&offer.cells).take(chunk.n_lanes()) {
                *max_range_m = visibility.max_range_m(*cell);
            }
            Arch::new().dispatch(Take { index, n_lanes: chunk.n_lanes(), projected, offer, best });
        }
    }
}

/// Computes the costs of an exposure and the points that it is offered to. Returns whether there are any such points.
struct Weigh<'a> {
    index: u32,
    /// Time of the exposure, s after the submap's first shot.
    time: f32,
    /// Added to the cost of every point, m.
    extra_m: f32,
    exposure: PosedExposure<'a>,
    grid: CellGrid,
    limits: AgeLimits,
    chunk: &'a Chunk,
    projected: &'a Projected,
    best: &'a Best,
    offer: &'a mut Offer,
}

impl NullaryFnOnce for Weigh<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self { index, time, extra_m, exposure, grid, limits, chunk, projected, best, offer } = self;
        let middle = [0, 1].map(|axis| 0.5 * (exposure.min[axis] + exposure.max[axis]));
        let per_half = [0, 1].map(|axis| 2.0 / (exposure.max[axis] - exposure.min[axis]));
        let mut n_offered = 0_u32;
        for i in 0..chunk.n_lanes() {
            let u = projected.u[i];
            let v = projected.v[i];
            let age_s = (chunk.times[i] - time).abs();
            let x = (u - middle[0]) * per_half[0];
            let y = (v - middle[1]) * per_half[1];
            let cost =
                extra_m + DRIFT_M_PER_S * age_s + POINTING_RAD * projected.range_m[i] * (1.0 + 0.5 * (x * x + y * y));
            let is_better = (cost < best.costs[i]) | ((cost == best.costs[i]) & (index < best.exposures[i]));
            let is_offered = exposure.contains(u, v) & (age_s <= limits.max_age_s_of(chunk.moves[i])) & is_better;
            offer.costs[i] = cost;
            offer.cells[i] = if is_offered { grid.cell(u, v) } else { NO_CELL };
            n_offered += u32::from(is_offered);
        }
        n_offered > 0
    }
}

/// Assigns the exposure to the points that it shows.
struct Take<'a> {
    index: u32,
    n_lanes: usize,
    projected: &'a Projected,
    offer: &'a Offer,
    best: &'a mut Best,
}

impl NullaryFnOnce for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { index, n_lanes, projected, offer, best } = self;
        for i in 0..n_lanes.min(CHUNK) {
            let is_seen = projected.range_m[i] <= offer.max_range_m[i];
            best.costs[i] = if is_seen { offer.costs[i] } else { best.costs[i] };
            best.exposures[i] = if is_seen { index } else { best.exposures[i] };
            best.u[i] = if is_seen { projected.u[i] } else { best.u[i] };
            best.v[i] = if is_seen { projected.v[i] } else { best.v[i] };
        }
    }
}

/// Extra cost of an exposure at `time`; see [`OUTSIDE_SUBMAP_M`].
fn outside_submap_m(candidates: &Candidates<'_>, time: f32) -> f32 {
    if gap(time, candidates.points.time_span()) > 0.0 { OUTSIDE_SUBMAP_M } else { 0.0 }
}

/// An exposure that may show points of a chunk.
struct OrderedExposure {
    index: u32,
    /// Lower bound of its cost for any point, m.
    least_m: f32,
}

/// The exposures that may show points of the chunk. The cheapest come
/// first: most points then have an exposure before the expensive ones are considered.
fn by_least_cost(candidates: &Candidates<'_>, chunk: &Chunk) -> Vec<OrderedExposure> {
    let least = |exposure: &PosedExposure<'_>| {
        let time = seconds(exposure.stamp, candidates.points.origin);
        let gap_s = gap(time, chunk.time_span);
        let extra_m = outside_submap_m(candidates, time);
        extra_m + DRIFT_M_PER_S * gap_s + POINTING_RAD * distance_m(&exposure.position, &chunk.bounds)
    };
    let near = (0..).zip(candidates.exposures).filter(|(index, _)| candidates.may_see(*index as usize, chunk));
    let ordered = near.map(|(index, exposure)| OrderedExposure { index, least_m: least(exposure) });
    let mut order: Vec<OrderedExposure> = ordered.collect();
    order.sort_by(|a, b| a.least_m.total_cmp(&b.least_m).then(a.index.cmp(&b.index)));
    order
}

/// Distance from a position to a box, minus the rounding error of both.
fn distance_m(from: &[f32; 3], [min, max]: &[[f32; 3]; 2]) -> f32 {
    let square: f32 = (0..3).map(|axis| (min[axis] - from[axis]).max(from[axis] - max[axis]).max(0.0).powi(2)).sum();
    (square.sqrt() - 0.01).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::ProjectionCamera;
    use crate::points::{PointBuffers, SubmapPoints};
    use crate::visibility::VisibilityMap;
    use geometry::{CameraModel, Isometry3, Pinhole, Pose, RigCamera, Vector3};
    use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};

    const MS: i64 = 1_000_000;

    /// Index of the exposure that is chosen for a point 10 m ahead, shot at 1000 ms. The limit is 128 ms, or 32 ms if the
    /// point moves. An exposure is given by its stamp in ms, whether it faces the point, and its distance behind the
    /// others in m.
    fn chosen(exposures: &[(i64, bool, f64)], flags: u8) -> Option<usize> {
        let width = 100;
        let height = 100;
        let fx = 50.0;
        let fy = 50.0;
        let cx = 50.0;
        let cy = 50.0;
        let model = CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] });
        let camera = ProjectionCamera::from(&RigCamera { body_from_camera: Pose::identity(), model });
        let exposure = |(stamp, faces, behind): &(i64, bool, f64)| {
            let turn = Vector3::y() * if *faces { 0.0 } else { std::f64::consts::PI };
            camera.exposure(stamp * MS, &Isometry3::new(Vector3::new(0.0, 0.0, -behind), turn), &Pose::identity())
        };
        let exposures: Vec<PosedExposure<'_>> = exposures.iter().map(exposure).collect();
        let visibility: Vec<VisibilityMap> = exposures.iter().map(|_| VisibilityMap::unobstructed()).collect();
        let sweeps = [SubmapSweep { stamp: 990 * MS, ..SubmapSweep::default() }];
        let point = SubmapPoint { z: 10.0, offset_nanos: 10_000_000, flags, ..SubmapPoint::default() };
        // Points of other times and of an unknown sweep, so that the chunk is wider than the point.
        let early = SubmapPoint { offset_nanos: 0, ..point };
        let late = SubmapPoint { offset_nanos: 60_000_000, ..point };
        let lost = SubmapPoint { sweep_idx: 1, ..point };
        let mut choices = Choices::default();
        let limits = AgeLimits { max_age_s: 0.128, max_moving_age_s: 0.032 };
        let points = [early, point, late, lost];
        let mut buffers = PointBuffers::default();
        let points = SubmapPoints::new(&points, &sweeps, 1000 * MS, 32, &mut buffers);
        let candidates = Candidates { points: &points, exposures: &exposures, visibility: &visibility, limits };
        let mut chunk = Chunk::default();
        points.read_chunk(0, &mut chunk);
        choices.choose(&chunk, &candidates);
        let exposure_of = |point| choices.chosen().find(|choice| choice.i == point).map(|choice| choice.exposure);
        assert_eq!(exposure_of(3), None, "a point of an unknown sweep has no time");
        exposure_of(1)
    }

    #[test]
    fn nearest_exposure_in_time_that_sees_point_is_chosen() {
        assert_eq!(chosen(&[(940, true, 0.0), (1050, true, 0.0), (1070, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(940, true, 0.0), (1050, false, 0.0), (1070, true, 0.0)], 0), Some(0));
        assert_eq!(chosen(&[(940, false, 0.0), (1050, false, 0.0), (1070, true, 0.0)], 0), Some(2));
    }

    #[test]
    fn far_exposure_loses_to_slightly_older_one() {
        // 20 ms of age cost a millimetre, 30 m of range cost 30 millimetres.
        assert_eq!(chosen(&[(1010, true, 30.0), (1030, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(1010, true, 0.1), (1030, true, 0.0)], 0), Some(0));
    }

    #[test]
    fn exposure_before_submap_loses_to_one_within() {
        // The shots are from 990 to 1050 ms.
        assert_eq!(chosen(&[(985, true, 0.0), (1040, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(985, true, 0.0), (1040, false, 0.0)], 0), Some(0));
    }

    #[test]
    fn first_of_equally_good_exposures_is_chosen() {
        assert_eq!(chosen(&[(936, true, 0.0), (1064, true, 0.0)], 0), Some(0));
        assert_eq!(chosen(&[(1064, true, 0.0), (936, true, 0.0)], 0), Some(0));
    }

    #[test]
    fn exposure_beyond_age_limit_is_not_chosen() {
        assert_eq!(chosen(&[(873, true, 0.0)], 0), Some(0));
        assert_eq!(chosen(&[(871, true, 0.0)], 0), None);
        assert_eq!(chosen(&[(1129, true, 0.0)], 0), None);
        assert_eq!(chosen(&[(1031, true, 0.0)], POINT_DYNAMIC), Some(0));
        assert_eq!(chosen(&[(1033, true, 0.0)], POINT_DYNAMIC), None);
        assert_eq!(chosen(&[], 0), None);
    }
}
