//! Which exposure gives a point its color: of those that see it, the one that is expected to be off by the least.

use crate::chunk::{Chunk, Cloud, Extent, Projected, seconds};
use crate::frustum::Frustum;
use crate::lens::Lens;
use crate::occlusion::Sight;
use messages::SubmapPoint;

/// How far the pose of an exposure drifts from that of a shot, m per second between them: half a percent of 10 m/s.
const DRIFT_M_PER_S: f32 = 0.05;

/// Error of mounting and lens in the middle of an image, rad; at the rim of the image it is twice that.
const POINTING_RAD: f32 = 0.001;

/// An exposure whose pose is known.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Middle of the exposure, ns since the Unix epoch.
    pub stamp: i64,
    /// Rows of the 3x4 matrix.
    pub camera_from_submap: [[f32; 4]; 3],
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
    #[inline]
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

/// Everything that colors of one submap come from.
pub struct Sources<'a> {
    /// The submap.
    pub cloud: &'a Cloud<'a>,
    /// Exposures.
    pub views: &'a [View<'a>],
    /// How far each of them sees, by index.
    pub sights: &'a [Sight],
    /// Largest ages.
    pub limits: Limits,
}

/// What was chosen for the points of a chunk.
#[derive(Debug, Default)]
pub struct Choices {
    chunk: Chunk,
    projected: Projected,
    costs: Vec<f32>,
    best_costs: Vec<f32>,
    views: Vec<u32>,
    pixels: Vec<[f32; 2]>,
}

/// Index of the view of a point that is not seen.
pub const NO_VIEW: u32 = u32::MAX;

impl Choices {
    /// Index of the view, and where the point is on its image (px), point by point; `None` if no view has it.
    pub fn iter(&self) -> impl Iterator<Item = Option<(usize, [f32; 2])>> {
        let choice = |(view, pixel): (&u32, &[f32; 2])| (*view != NO_VIEW).then_some((*view as usize, *pixel));
        self.views.iter().zip(&self.pixels).map(choice)
    }

    /// Chooses anew, for the points of a chunk. Two views as good as each other: the first in the list. A point whose sweep
    /// is not known has no time and is not seen.
    pub fn fill(&mut self, points: &[SubmapPoint], extent: &Extent, sources: &Sources<'_>) {
        let n = points.len();
        self.views.clear();
        self.views.resize(n, NO_VIEW);
        self.pixels.resize(n, [0.0; 2]);
        self.best_costs.clear();
        self.best_costs.resize(n, f32::INFINITY);
        self.costs.resize(n, 0.0);
        let mut is_filled = false;
        for (index, gap_s) in in_order(sources, extent) {
            let (Some(view), Some(sight)) = (sources.views.get(index as usize), sources.sights.get(index as usize))
            else {
                continue;
            };
            if !view.frustum.meets(&extent.bounds) {
                continue;
            }
            if !is_filled {
                self.chunk.fill(sources.cloud, points);
                is_filled = true;
            }
            let least = DRIFT_M_PER_S * gap_s;
            if self.best_costs.iter().any(|cost| *cost >= least) {
                self.offer(index, view, sight, sources);
            }
        }
    }

    /// Gives the view to the points that it sees and that have none better.
    fn offer(&mut self, index: u32, view: &View<'_>, sight: &Sight, sources: &Sources<'_>) {
        let time = seconds(view.stamp, sources.cloud.origin);
        let n = self.chunk.len();
        self.projected.fill(&self.chunk, &view.camera_from_submap, view.lens);
        let (u, v, range_m) = (&self.projected.u[..n], &self.projected.v[..n], &self.projected.range_m[..n]);
        let (times, moves, costs) = (&self.chunk.times[..n], &self.chunk.moves[..n], &mut self.costs[..n]);
        let middle = [0, 1].map(|axis| 0.5 * (view.min[axis] + view.max[axis]));
        let per_half = [0, 1].map(|axis| 2.0 / (view.max[axis] - view.min[axis]));
        for i in 0..n {
            let age_s = (times[i] - time).abs();
            let (x, y) = ((u[i] - middle[0]) * per_half[0], (v[i] - middle[1]) * per_half[1]);
            let cost = DRIFT_M_PER_S * age_s + POINTING_RAD * range_m[i] * (1.0 + 0.5 * (x * x + y * y));
            let limit = if moves[i] { sources.limits.max_moving_age_s } else { sources.limits.max_age_s };
            costs[i] = if view.holds(u[i], v[i]) & (age_s <= limit) { cost } else { f32::INFINITY };
        }
        for i in 0..n {
            let (cost, best) = (costs[i], self.best_costs[i]);
            let is_better = cost < best || (cost == best && cost.is_finite() && index < self.views[i]);
            if is_better && sight.reaches(u[i], v[i], range_m[i]) {
                self.best_costs[i] = cost;
                self.views[i] = index;
                self.pixels[i] = [u[i], v[i]];
            }
        }
    }
}

/// The views that may serve shots of this time, with the smallest possible gap between, s; nearest first: most points have
/// their view when the far ones come.
fn in_order(sources: &Sources<'_>, extent: &Extent) -> Vec<(u32, f32)> {
    let gap_of = |view: &View<'_>| gap(seconds(view.stamp, sources.cloud.origin), extent.time_span);
    let mut order: Vec<(u32, f32)> = (0..).zip(sources.views.iter().map(gap_of)).collect();
    order.retain(|(_, gap_s)| *gap_s <= sources.limits.max_age_s);
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    order
}

/// From a time to the nearest in a span; infinite if the span is empty.
pub fn gap(time: f32, [first, last]: [f32; 2]) -> f32 {
    (first - time).max(time - last).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::views::Camera;
    use geometry::{CameraModel, Isometry3, Pinhole, Pose, RigCamera, Vector3};
    use messages::{POINT_DYNAMIC, SubmapSweep};

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
        let cloud = Cloud::new(&points, &sweeps, 1000 * MS, 32);
        let sources = Sources { cloud: &cloud, views: &views, sights: &sights, limits };
        choices.fill(&points, &cloud.extents()[0], &sources);
        let found: Vec<_> = choices.iter().map(|choice| choice.map(|(view, _)| view)).collect();
        assert_eq!(found[3], None, "a point without a sweep has no time");
        found[1]
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
        assert_eq!(chosen(&[(990, true, 30.0), (970, true, 0.0)], 0), Some(1));
        assert_eq!(chosen(&[(990, true, 0.1), (970, true, 0.0)], 0), Some(0));
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
