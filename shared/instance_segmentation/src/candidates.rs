//! Points that may belong to an object of a class.

use crate::settings::Kind;
use crate::top_view::{Cell, ThingPoint, TopView};
use messages::SubmapPoint;

/// A point of the class below its height limit.
#[derive(Clone, Copy)]
pub(crate) struct Candidate {
    pub(crate) point_idx: u32,
    pub(crate) cell: Cell,
    /// Height above the ground, m.
    pub(crate) above_m: f32,
    /// Time, ns since the Unix epoch.
    pub(crate) time: i64,
}

/// The candidates of a class in the order of the submap. `is_class` has one element for each of
/// [`TopView::thing_points`].
pub(crate) fn candidates(
    view: &TopView,
    points: &[SubmapPoint],
    is_class: &[bool],
    time_of: impl Fn(&SubmapPoint) -> i64,
    kind: &Kind,
) -> Vec<Candidate> {
    let of_class = view.thing_points.iter().zip(is_class).filter(|(_, is_class)| **is_class);
    let candidate = |(&ThingPoint { point_idx, cell }, _): (&ThingPoint, &bool)| {
        let point = &points[point_idx as usize];
        let above_m = view.above_ground(point, cell);
        let is_low = view.terrain_m.is_none() || above_m <= kind.max_height_m;
        is_low.then(|| Candidate { point_idx, cell, above_m, time: time_of(point) })
    };
    of_class.filter_map(candidate).collect()
}
