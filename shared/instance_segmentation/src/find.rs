//! Objects of one class: parts of the footprint, separated by time and joined if they are near.

use crate::candidates::{Candidate, candidates};
use crate::footprints::Footprints;
use crate::joining::join;
use crate::movers::Movers;
use crate::object::{Object, Waypoint};
use crate::rays::Rays;
use crate::sets::SetNumbers;
use crate::settings::{FootprintSettings, Kind};
use crate::top_view::TopView;
use crate::visits::{END_WINDOW_NANOS, Visits};
use messages::SubmapPoint;

/// All objects of one class in the view, in the order of their first points. `is_class` has one element for each of
/// [`TopView::thing_points`]; `time_of` returns ns since the Unix epoch.
pub fn find(
    view: &TopView,
    points: &[SubmapPoint],
    rays: &Rays<'_>,
    is_class: &[bool],
    time_of: impl Fn(&SubmapPoint) -> i64,
    kind: &Kind,
    settings: &FootprintSettings,
) -> Vec<Object> {
    if !is_class.contains(&true) {
        return Vec::new();
    }
    let all = candidates(view, points, is_class, &time_of, kind);
    let movers = Movers::detect(view, points, rays, &all, 2.0 * settings.dilation_m, kind);
    let mut objects = in_place(view, all, kind, settings);
    movers.unite(&mut objects, points, &time_of);
    if kind.join_m > 0.0 {
        objects = join(objects, view, kind);
    }
    for object in &mut objects {
        object.middle = middle(object, points, &time_of);
    }
    objects
}

/// Mean time and position of the points of an object.
fn middle(object: &Object, points: &[SubmapPoint], time_of: impl Fn(&SubmapPoint) -> i64) -> Waypoint {
    let n = object.points.len().max(1);
    let of_object = || object.points.iter().map(|&point_idx| &points[point_idx as usize]);
    let nanos: i128 = of_object().map(|point| i128::from(time_of(point).saturating_sub(object.begin_nanos))).sum();
    let mean = |of: fn(&SubmapPoint) -> f32| of_object().map(|point| f64::from(of(point))).sum::<f64>() / n as f64;
    let center = [mean(|point| point.x), mean(|point| point.y)];
    Waypoint { nanos: object.begin_nanos.saturating_add((nanos / n as i128) as i64), center }
}

/// Objects that are one part of the footprint and one visit of it.
fn in_place(view: &TopView, candidates: Vec<Candidate>, kind: &Kind, settings: &FootprintSettings) -> Vec<Object> {
    let footprints = Footprints::from_candidates(view, candidates, kind, settings);
    let is_timed = settings.apart_s > 0.0;
    let apart_nanos = if is_timed { (settings.apart_s * 1e9) as i64 } else { i64::MAX };
    let visits = Visits::from_footprints(&footprints, apart_nanos);
    let SetNumbers { by_member: numbers, n } = if is_timed {
        // Dilated cells touch up to this distance.
        visits.groups(&footprints, apart_nanos, 2 * view.in_cells(settings.dilation_m) + 1)
    } else {
        let parts = visits.all.iter().map(|visit| footprints.parts[visit.cell] - 1);
        SetNumbers { by_member: parts.collect(), n: footprints.n }
    };
    let mut objects: Vec<Object> = (0..n).map(|_| Object::empty()).collect();
    for (visit, &number) in visits.all.iter().zip(&numbers) {
        let object = &mut objects[number as usize];
        object.begin_nanos = object.begin_nanos.min(visit.begin);
        object.end_nanos = object.end_nanos.max(visit.end);
    }
    for (visit, &number) in visits.all.iter().zip(&numbers) {
        let object = &mut objects[number as usize];
        object.footprint.all.push(visit.cell);
        if visit.begin <= object.begin_nanos.saturating_add(END_WINDOW_NANOS) {
            object.footprint.at_first.push(visit.cell);
        }
        if visit.end >= object.end_nanos.saturating_sub(END_WINDOW_NANOS) {
            object.footprint.at_last.push(visit.cell);
        }
        let around = footprints.ground_around[footprints.parts[visit.cell] as usize];
        object.is_grounded |= around.is_none_or(|share| share >= settings.min_ground_around);
    }
    for (candidate, &visit) in footprints.candidates.iter().zip(&visits.of_candidate) {
        objects[numbers[visit as usize] as usize].points.push(candidate.point_idx);
    }
    objects.retain(|object| !object.points.is_empty());
    objects.iter_mut().for_each(Object::sort);
    objects
}
