//! Which exposure shows a point: the nearest in time of those that have the point in view.

use crate::lens::{Lens, Project};
use messages::{SubmapPoint, SubmapSweep};

/// Points that are worked on together: they and their choices fit the second cache (2048 * 44 bytes). A constant, so
/// that the work is cut in the same places whatever the number of threads.
pub const CHUNK: usize = 2048;

/// An exposure whose pose is known.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Middle of the exposure, ns since the Unix epoch.
    pub stamp: i64,
    /// Rows of the 3x4 matrix.
    pub camera_from_submap: [[f32; 4]; 3],
    /// Lens of the camera.
    pub lens: &'a Lens,
    /// Usable part of the image: `min <= pixel < max` for u and v, px.
    pub min: [f32; 2],
    /// See `min`.
    pub max: [f32; 2],
}

/// Stamp of a point that has none: 292 years before the epoch, out of every view's reach.
const NO_STAMP: i64 = i64::MIN;

/// What was chosen for a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Index of the view; [`Choice::NONE`] = no view has the point.
    pub view: u32,
    /// Where the point is on its image, px.
    pub pixel: [f32; 2],
    /// Between the point's stamp and the view's, ns.
    gap_nanos: u64,
}

impl Choice {
    /// [`Choice::view`] of a point that is not seen.
    pub const NONE: u32 = u32::MAX;

    /// The view's index, if there is one.
    pub fn seen(&self) -> Option<usize> {
        (self.view != Self::NONE).then_some(self.view as usize)
    }
}

/// Chooses among `views` for every point of a chunk; two views equally near in time: the first in the list. Views
/// farther than `max_age_nanos` from a point's stamp are not for it. A point whose sweep is not in `sweeps` has no stamp
/// and is not seen.
pub fn choose(
    points: &[SubmapPoint],
    sweeps: &[SubmapSweep],
    views: &[View<'_>],
    max_age_nanos: u64,
    choices: &mut Vec<Choice>,
) {
    let stamps: Vec<i64> = points.iter().map(|point| stamp(point, sweeps).unwrap_or(NO_STAMP)).collect();
    let known = || stamps.iter().filter(|stamp| **stamp != NO_STAMP);
    choices.clear();
    // Every view has a smaller index than none, so one exactly at the limit is still better than none.
    let unseen = Choice { view: Choice::NONE, pixel: [0.0; 2], gap_nanos: max_age_nanos };
    choices.resize(points.len(), unseen);
    let (Some(first), Some(last)) = (known().min(), known().max()) else { return };

    // Nearest first, so that most points have their view when the far ones come. The smallest possible gap of a view:
    let least_gap = |view: &View<'_>| first.saturating_sub(view.stamp).max(view.stamp.saturating_sub(*last)).max(0);
    let mut order: Vec<(u64, u32)> = (0..).zip(views).map(|(i, view)| (least_gap(view).unsigned_abs(), i)).collect();
    order.retain(|(gap, _)| *gap <= max_age_nanos);
    order.sort_unstable();
    for (_, index) in order {
        let view = &views[index as usize];
        match view.lens {
            Lens::Pinhole(lens) => offer(points, &stamps, index, view, lens, choices),
            Lens::Fisheye(lens) => offer(points, &stamps, index, view, lens, choices),
        }
    }
}

fn stamp(point: &SubmapPoint, sweeps: &[SubmapSweep]) -> Option<i64> {
    Some(sweeps.get(usize::from(point.sweep_idx))?.stamp.saturating_add(i64::from(point.offset_nanos)))
}

/// Gives the view to the points that have it in sight and nothing nearer.
fn offer<L: Project>(
    points: &[SubmapPoint],
    stamps: &[i64],
    index: u32,
    view: &View<'_>,
    lens: &L,
    choices: &mut [Choice],
) {
    let rows = &view.camera_from_submap;
    for ((point, stamp), choice) in points.iter().zip(stamps).zip(choices) {
        let gap_nanos = stamp.abs_diff(view.stamp);
        if (gap_nanos, index) >= (choice.gap_nanos, choice.view) {
            continue;
        }
        let p_in_camera = rows.map(|[a, b, c, d]| a * point.x + b * point.y + c * point.z + d);
        let Some([u, v]) = lens.pixel(p_in_camera) else { continue };
        if u >= view.min[0] && v >= view.min[1] && u < view.max[0] && v < view.max[1] {
            *choice = Choice { view: index, pixel: [u, v], gap_nanos };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{CameraModel, Pinhole};

    const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    const AWAY: [[f32; 4]; 3] = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]];

    fn lens() -> Lens {
        let (width, height, fx, fy, cx, cy) = (100, 100, 50.0, 50.0, 50.0, 50.0);
        (&CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] })).into()
    }

    /// Which of `views` (stamp, pose) is chosen for a point 1 m ahead, shot at 1000 ns, with `max_age` of 100 ns.
    fn chosen(views: &[(i64, [[f32; 4]; 3])]) -> Option<usize> {
        let lens = lens();
        let view = |(stamp, pose): &_| View {
            stamp: *stamp,
            camera_from_submap: *pose,
            lens: &lens,
            min: [0.0; 2],
            max: [99.0; 2],
        };
        let views: Vec<View<'_>> = views.iter().map(view).collect();
        let sweeps = [SubmapSweep { stamp: 990, ..SubmapSweep::default() }];
        let point = SubmapPoint { z: 1.0, offset_nanos: 10, ..SubmapPoint::default() };
        // Company of other times and without a sweep, so that the chunk is wider than the point.
        let early = SubmapPoint { offset_nanos: 0, ..point };
        let late = SubmapPoint { offset_nanos: 60, ..point };
        let lost = SubmapPoint { sweep_idx: 1, ..point };
        let mut choices = Vec::new();
        choose(&[early, point, late, lost], &sweeps, &views, 100, &mut choices);
        assert_eq!(choices[3].seen(), None, "a point without a sweep has no time");
        choices[1].seen()
    }

    #[test]
    fn the_nearest_view_in_time_that_sees_the_point_is_chosen() {
        assert_eq!(chosen(&[(940, IDENTITY), (1050, IDENTITY), (1070, IDENTITY)]), Some(1));
        assert_eq!(chosen(&[(940, IDENTITY), (1050, AWAY), (1070, IDENTITY)]), Some(0));
        assert_eq!(chosen(&[(940, AWAY), (1050, AWAY), (1070, IDENTITY)]), Some(2));
    }

    #[test]
    fn equally_near_views_are_taken_in_their_order() {
        assert_eq!(chosen(&[(950, IDENTITY), (1050, IDENTITY)]), Some(0));
        assert_eq!(chosen(&[(1050, IDENTITY), (950, IDENTITY)]), Some(0));
    }

    #[test]
    fn the_limit_is_allowed_and_what_is_beyond_is_not() {
        assert_eq!(chosen(&[(900, IDENTITY)]), Some(0));
        assert_eq!(chosen(&[(899, IDENTITY)]), None);
        assert_eq!(chosen(&[(1101, IDENTITY)]), None);
        assert_eq!(chosen(&[(i64::MIN, IDENTITY), (i64::MAX, IDENTITY)]), None);
        assert_eq!(chosen(&[]), None);
    }
}
