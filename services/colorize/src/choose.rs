//! Which exposure gives a point its color: of those that see it, the one that is expected to be off by the least.

use crate::chunk::{CHUNK, Chunk, Lanes, Projected, seconds};
use crate::cloud::Cloud;
use crate::frustum::Frustum;
use crate::lens::Lens;
use crate::occlusion::{Grid, NO_CELL, Sight};
use pulp::{Arch, NullaryFnOnce};

/// How far the pose of an exposure drifts from that of a shot, m per second between them: half a percent of 10 m/s.
const DRIFT_M_PER_S: f32 = 0.05;

/// An exposure before the submap's first shot or after its last costs so much more, m: what moved past the camera then is in another
/// submap, and hides nothing here.
const UNGUARDED_M: f32 = 0.05;

/// Error of mounting and lens in the middle of an image, rad; at the rim of the image it is twice that.
const POINTING_RAD: f32 = 0.001;

/// An exposure whose pose is known.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Middle of the exposure, ns since the Unix epoch.
    pub stamp: i64,
    /// Rows of the 3x4 matrix.
    pub camera_from_submap: [[f32; 4]; 3],
    /// Of the camera, m, submap frame.
    pub position: [f32; 3],
    /// Lens of the camera.
    pub lens: &'a Lens,
    /// Outside of this the camera sees nothing.
    pub frustum: Frustum,
    /// Usable part of the image: `min <= pixel < max` for u and v, px.
    pub min: [f32; 2],
    /// See `min`.
    pub max: [f32; 2],
}

impl View<'_> {
    /// Whether the pixel is on the usable part.
    #[inline(always)]
    pub fn holds(&self, u: f32, v: f32) -> bool {
        // All four at once instead of one after the other, so that loops over this have no jumps. NaN is in no image.
        (u >= self.min[0]) & (v >= self.min[1]) & (u < self.max[0]) & (v < self.max[1])
    }
}

/// Between shot and exposure, at most.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// s.
    pub max_age_s: f32,
    /// The same for points on moving objects, s.
    pub max_moving_age_s: f32,
}

impl Limits {
    #[inline(always)]
    fn max_age_s_of(self, moves: u32) -> f32 {
        if moves != 0 { self.max_moving_age_s } else { self.max_age_s }
    }
}

/// Everything that colors of one submap come from.
pub struct Sources<'a> {
    /// The submap.
    pub cloud: &'a Cloud<'a>,
    /// Exposures.
    pub views: &'a [View<'a>],
    /// How far each of them sees, by index: as many as there are views.
    pub sights: &'a [Sight],
    /// Largest ages.
    pub limits: Limits,
}

impl Sources<'_> {
    fn unguarded_m(&self, time: f32) -> f32 {
        if gap(time, self.cloud.time_span()) > 0.0 { UNGUARDED_M } else { 0.0 }
    }

    /// Where a point of a chunk is on a view's image, px, if that sees it.
    pub fn seen(&self, view: usize, chunk: &Chunk, i: usize) -> Option<[f32; 2]> {
        let sight = &self.sights[view];
        let view = &self.views[view];
        let p = [chunk.x[i], chunk.y[i], chunk.z[i]];
        let p = view.camera_from_submap.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d);
        let [u, v] = view.lens.pixel(p);
        let age_s = (chunk.times[i] - seconds(view.stamp, self.cloud.origin)).abs();
        let range_m = p.iter().map(|v| v * v).sum::<f32>().sqrt();
        let sees = view.holds(u, v)
            && age_s <= self.limits.max_age_s_of(chunk.moves[i])
            && range_m <= sight.reach_m(sight.grid.cell(u, v));
        sees.then_some([u, v])
    }
}

/// What was chosen for the points of a chunk.
#[derive(Debug, Default)]
pub struct Choices {
    projected: Projected,
    offer: Offer,
    best: Best,
    /// Of the best; none if no view comes near the chunk.
    n_points: usize,
}

/// The view at hand, point by point.
#[derive(Debug)]
struct Offer {
    /// How far the color is expected to be off, m.
    costs: Lanes<f32>,
    /// Of the view's sight; one that there is not if the view does not serve the point, or not better than another.
    cells: Lanes<u32>,
    reach_m: Lanes<f32>,
}

impl Default for Offer {
    fn default() -> Self {
        Self { costs: [0.0; CHUNK], cells: [0; CHUNK], reach_m: [0.0; CHUNK] }
    }
}

/// The best view so far, point by point.
#[derive(Debug)]
struct Best {
    costs: Lanes<f32>,
    views: Lanes<u32>,
    u: Lanes<f32>,
    v: Lanes<f32>,
}

impl Default for Best {
    fn default() -> Self {
        Self { costs: [f32::INFINITY; CHUNK], views: [NO_VIEW; CHUNK], u: [0.0; CHUNK], v: [0.0; CHUNK] }
    }
}

/// Index of the view of a point that is not seen.
pub const NO_VIEW: u32 = u32::MAX;

impl Choices {
    /// Index of the view, and where the point is on its image (px), for all points that some view sees, with the point's
    /// place in the chunk.
    pub fn seen(&self) -> impl Iterator<Item = (usize, usize, [f32; 2])> {
        let Best { views, u, v, .. } = &self.best;
        let places = (0..self.n_points).filter(|i| views[*i] != NO_VIEW);
        places.map(|i| (i, views[i] as usize, [u[i], v[i]]))
    }

    /// Of other views that see a point of the chunk and give it a color that is `good`, the one that is expected to be off by the least.
    pub fn other(
        i: usize,
        chunk: &Chunk,
        sources: &Sources<'_>,
        good: impl Fn(usize, [f32; 2]) -> bool,
    ) -> Option<(usize, [f32; 2])> {
        let off_m = |view: &View<'_>| {
            let time = seconds(view.stamp, sources.cloud.origin);
            let p = [[chunk.x[i]; 2], [chunk.y[i]; 2], [chunk.z[i]; 2]];
            let way_m = distance_m(&view.position, &[p.map(|v| v[0]), p.map(|v| v[1])]);
            sources.unguarded_m(time) + DRIFT_M_PER_S * (chunk.times[i] - time).abs() + POINTING_RAD * way_m
        };
        let seen = (0..sources.views.len()).filter_map(|view| Some((view, sources.seen(view, chunk, i)?)));
        let good = seen.filter(|(view, pixel)| good(*view, *pixel));
        good.min_by(|(a, _), (b, _)| off_m(&sources.views[*a]).total_cmp(&off_m(&sources.views[*b])))
    }

    /// Chooses anew, for the points of a chunk. Two views as good as each other: the first in the list. A point whose sweep
    /// is not known has no time and is not seen.
    pub fn fill(&mut self, chunk: &Chunk, sources: &Sources<'_>) {
        let order = in_order(sources, chunk);
        self.n_points = if order.is_empty() { 0 } else { chunk.n_points };
        if order.is_empty() {
            return;
        }
        self.best.views.fill(NO_VIEW);
        self.best.costs.fill(f32::INFINITY);
        for (index, least) in order {
            if self.best.costs.iter().take(self.n_points).all(|cost| *cost < least) {
                break;
            }
            self.offer(index, chunk, sources);
        }
    }

    /// Gives the view to the points that it sees and that have none better.
    fn offer(&mut self, index: u32, chunk: &Chunk, sources: &Sources<'_>) {
        let (view, sight) = (&sources.views[index as usize], &sources.sights[index as usize]);
        let Self { projected, offer, best, .. } = self;
        projected.fill(chunk, &view.camera_from_submap, view.lens);
        let time = seconds(view.stamp, sources.cloud.origin);
        let extra_m = sources.unguarded_m(time);
        let is_offered = Arch::new().dispatch(Weigh {
            index,
            time,
            extra_m,
            view: *view,
            grid: sight.grid,
            limits: sources.limits,
            chunk,
            projected,
            best,
            offer,
        });
        if is_offered {
            for (reach_m, cell) in offer.reach_m.iter_mut().zip(&offer.cells).take(chunk.n_lanes()) {
                *reach_m = sight.reach_m(*cell);
            }
            Arch::new().dispatch(Take { index, n_lanes: chunk.n_lanes(), projected, offer, best });
        }
    }
}

/// Finds what a view costs, and to which points it is offered; says whether to any.
struct Weigh<'a> {
    index: u32,
    /// Of the view, s after the submap's first shot.
    time: f32,
    /// Added to the cost of every point, m.
    extra_m: f32,
    view: View<'a>,
    grid: Grid,
    limits: Limits,
    chunk: &'a Chunk,
    projected: &'a Projected,
    best: &'a Best,
    offer: &'a mut Offer,
}

impl NullaryFnOnce for Weigh<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self { index, time, extra_m, view, grid, limits, chunk, projected, best, offer } = self;
        let middle = [0, 1].map(|axis| 0.5 * (view.min[axis] + view.max[axis]));
        let per_half = [0, 1].map(|axis| 2.0 / (view.max[axis] - view.min[axis]));
        let mut n_offered = 0_u32;
        for i in 0..chunk.n_lanes() {
            let (u, v) = (projected.u[i], projected.v[i]);
            let age_s = (chunk.times[i] - time).abs();
            let (x, y) = ((u - middle[0]) * per_half[0], (v - middle[1]) * per_half[1]);
            let cost =
                extra_m + DRIFT_M_PER_S * age_s + POINTING_RAD * projected.range_m[i] * (1.0 + 0.5 * (x * x + y * y));
            let is_better = (cost < best.costs[i]) | ((cost == best.costs[i]) & (index < best.views[i]));
            let is_offered = view.holds(u, v) & (age_s <= limits.max_age_s_of(chunk.moves[i])) & is_better;
            offer.costs[i] = cost;
            offer.cells[i] = if is_offered { grid.cell(u, v) } else { NO_CELL };
            n_offered += u32::from(is_offered);
        }
        n_offered > 0
    }
}

/// Gives the view to the points that it sees.
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
            let is_seen = projected.range_m[i] <= offer.reach_m[i];
            best.costs[i] = if is_seen { offer.costs[i] } else { best.costs[i] };
            best.views[i] = if is_seen { index } else { best.views[i] };
            best.u[i] = if is_seen { projected.u[i] } else { best.u[i] };
            best.v[i] = if is_seen { projected.v[i] } else { best.v[i] };
        }
    }
}

/// The views that may serve points of the chunk, with the least that they may cost any of them, m; cheapest first: most
/// points have their view when the dear ones come.
fn in_order(sources: &Sources<'_>, chunk: &Chunk) -> Vec<(u32, f32)> {
    let least = |view: &View<'_>| {
        let time = seconds(view.stamp, sources.cloud.origin);
        let gap_s = gap(time, chunk.time_span);
        let may_serve = gap_s <= sources.limits.max_age_s && view.frustum.meets(&chunk.bounds);
        let extra_m = sources.unguarded_m(time);
        may_serve.then(|| extra_m + DRIFT_M_PER_S * gap_s + POINTING_RAD * distance_m(&view.position, &chunk.bounds))
    };
    let mut order: Vec<(u32, f32)> =
        (0..).zip(sources.views).filter_map(|(index, view)| Some((index, least(view)?))).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    order
}

/// From a place to the nearest of a box, less the rounding of both.
fn distance_m(from: &[f32; 3], [min, max]: &[[f32; 3]; 2]) -> f32 {
    let square: f32 = (0..3).map(|axis| (min[axis] - from[axis]).max(from[axis] - max[axis]).max(0.0).powi(2)).sum();
    (square.sqrt() - 0.01).max(0.0)
}

/// From a time to the nearest in a span; infinite if the span is empty.
pub fn gap(time: f32, [first, last]: [f32; 2]) -> f32 {
    (first - time).max(time - last).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Memory;
    use crate::views::Camera;
    use geometry::{CameraModel, Isometry3, Pinhole, Pose, RigCamera, Vector3};
    use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};

    const MS: i64 = 1_000_000;

    /// Which of `views` (stamp in ms, whether it looks at the point, metres behind the others) is chosen for a point 10 m
    /// ahead, shot at 1000 ms, with at most 128 ms between them, 32 if it moves.
    fn chosen(views: &[(i64, bool, f64)], flags: u8) -> Option<usize> {
        let (width, height, fx, fy, cx, cy) = (100, 100, 50.0, 50.0, 50.0, 50.0);
        let model = CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] });
        let camera = Camera::from(&RigCamera { body_from_camera: Pose::identity(), model });
        let view = |(stamp, looks, behind): &(i64, bool, f64)| {
            let turn = Vector3::y() * if *looks { 0.0 } else { std::f64::consts::PI };
            camera.view(stamp * MS, &Isometry3::new(Vector3::new(0.0, 0.0, -behind), turn), &Pose::identity())
        };
        let views: Vec<View<'_>> = views.iter().map(view).collect();
        let sights: Vec<Sight> = views.iter().map(|_| Sight::free()).collect();
        let sweeps = [SubmapSweep { stamp: 990 * MS, ..SubmapSweep::default() }];
        let point = SubmapPoint { z: 10.0, offset_nanos: 10_000_000, flags, ..SubmapPoint::default() };
        // Company of other times and without a sweep, so that the chunk is wider than the point.
        let early = SubmapPoint { offset_nanos: 0, ..point };
        let late = SubmapPoint { offset_nanos: 60_000_000, ..point };
        let lost = SubmapPoint { sweep_idx: 1, ..point };
        let mut choices = Choices::default();
        let limits = Limits { max_age_s: 0.128, max_moving_age_s: 0.032 };
        let points = [early, point, late, lost];
        let mut memory = Memory::default();
        let cloud = Cloud::new(&points, &sweeps, 1000 * MS, 32, &mut memory);
        let sources = Sources { cloud: &cloud, views: &views, sights: &sights, limits };
        choices.fill(&cloud.chunks()[0], &sources);
        let view_of = |place| choices.seen().find(|(at, ..)| *at == place).map(|(_, view, _)| view);
        assert_eq!(view_of(3), None, "a point without a sweep has no time");
        view_of(1)
    }

    #[test]
    fn the_nearest_view_in_time_that_sees_the_point_is_chosen() {
        assert_eq!(chosen(&[(940, true, 0.0), (1050, true, 0.0), (1070, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(940, true, 0.0), (1050, false, 0.0), (1070, true, 0.0)], 0), Some(0));
        assert_eq!(chosen(&[(940, false, 0.0), (1050, false, 0.0), (1070, true, 0.0)], 0), Some(2));
    }

    #[test]
    fn a_view_from_afar_is_worth_less_than_one_a_little_older() {
        // 20 ms of age are a millimetre; 30 m of range are 30 of them.
        assert_eq!(chosen(&[(1010, true, 30.0), (1030, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(1010, true, 0.1), (1030, true, 0.0)], 0), Some(0));
    }

    #[test]
    fn a_view_from_before_the_submap_is_worth_less_than_one_within() {
        // The shots are from 990 to 1050 ms.
        assert_eq!(chosen(&[(985, true, 0.0), (1040, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(985, true, 0.0), (1040, false, 0.0)], 0), Some(0));
    }

    #[test]
    fn views_as_good_as_each_other_are_taken_in_their_order() {
        assert_eq!(chosen(&[(936, true, 0.0), (1064, true, 0.0)], 0), Some(0));
        assert_eq!(chosen(&[(1064, true, 0.0), (936, true, 0.0)], 0), Some(0));
    }

    #[test]
    fn what_is_too_old_is_not_taken_and_sooner_so_for_what_moves() {
        assert_eq!(chosen(&[(873, true, 0.0)], 0), Some(0));
        assert_eq!(chosen(&[(871, true, 0.0)], 0), None);
        assert_eq!(chosen(&[(1129, true, 0.0)], 0), None);
        assert_eq!(chosen(&[(1031, true, 0.0)], POINT_DYNAMIC), Some(0));
        assert_eq!(chosen(&[(1033, true, 0.0)], POINT_DYNAMIC), None);
        assert_eq!(chosen(&[], 0), None);
    }
}
