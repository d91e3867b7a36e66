//! Objects of one class: parts of the footprint, separated by time and joined if they are near.

use crate::footprints::Footprints;
use crate::settings::{FootprintSettings, Kind};
use crate::top_view::{Cell, TopView};
use crate::visits::{END_WINDOW_NANOS, Sets, Visits};
use geometry::OrientedRectangle;
use messages::SubmapPoint;

/// An object of the submap.
pub struct Object {
    /// Indices of its points, increasing.
    pub points: Vec<u32>,
    /// All cells, cells of its first and cells of its last half second, sorted.
    pub cells: [Vec<Cell>; 3],
    /// Times of its first and last point, ns since the Unix epoch.
    pub span: (i64, i64),
    /// Whether there is ground around it; `true` if unknown.
    pub is_grounded: bool,
}

/// All objects of one class in the view, in the order of their first points. `is_class` is for each of [`TopView::thing_points`];
/// `time_of` gives ns since the Unix epoch.
pub fn find(
    view: &TopView,
    points: &[SubmapPoint],
    is_class: &[bool],
    time_of: impl Fn(&SubmapPoint) -> i64,
    kind: &Kind,
    settings: &FootprintSettings,
) -> Vec<Object> {
    if !is_class.contains(&true) {
        return Vec::new();
    }
    let footprints = Footprints::of(view, points, is_class, kind, settings);
    let times = footprints.candidates.iter().map(|candidate| time_of(&points[candidate.point_idx as usize]));
    let is_timed = settings.apart_s > 0.0;
    let apart_nanos = if is_timed { (settings.apart_s * 1e9) as i64 } else { i64::MAX };
    let visits = Visits::of(&footprints, times, apart_nanos);
    let (numbers, n) = if is_timed {
        // Dilated cells touch up to this distance.
        visits.groups(&footprints, apart_nanos, 2 * view.in_cells(settings.dilation_m) + 1)
    } else {
        (visits.all.iter().map(|visit| footprints.parts[visit.cell] - 1).collect(), footprints.n)
    };
    let empty =
        || Object { points: Vec::new(), cells: Default::default(), span: (i64::MAX, i64::MIN), is_grounded: false };
    let mut objects: Vec<Object> = (0..n).map(|_| empty()).collect();
    for (visit, &number) in visits.all.iter().zip(&numbers) {
        let span = &mut objects[number as usize].span;
        *span = (span.0.min(visit.begin), span.1.max(visit.end));
    }
    for (visit, &number) in visits.all.iter().zip(&numbers) {
        let object = &mut objects[number as usize];
        object.cells[0].push(visit.cell);
        if visit.begin <= object.span.0.saturating_add(END_WINDOW_NANOS) {
            object.cells[1].push(visit.cell);
        }
        if visit.end >= object.span.1.saturating_sub(END_WINDOW_NANOS) {
            object.cells[2].push(visit.cell);
        }
        let around = footprints.ground_around[footprints.parts[visit.cell] as usize];
        object.is_grounded |= around.is_none_or(|share| share >= settings.min_ground_around);
    }
    for (candidate, &visit) in footprints.candidates.iter().zip(&visits.of_candidate) {
        objects[numbers[visit as usize] as usize].points.push(candidate.point_idx);
    }
    objects.retain(|object| !object.points.is_empty());
    objects.iter_mut().for_each(Object::sort);
    if kind.join_m > 0.0 { join(objects, view, kind) } else { objects }
}

impl Object {
    fn sort(&mut self) {
        self.points.sort_unstable();
        for cells in &mut self.cells {
            cells.sort_unstable();
            cells.dedup();
        }
    }

    fn append(&mut self, mut other: Self) {
        self.points.append(&mut other.points);
        for (cells, others) in self.cells.iter_mut().zip(&mut other.cells) {
            cells.append(others);
        }
        self.span = (self.span.0.min(other.span.0), self.span.1.max(other.span.1));
        self.is_grounded |= other.is_grounded;
    }
}

/// Joins nearby parts, the nearest first, if the result is not longer than an object of the class.
fn join(objects: Vec<Object>, view: &TopView, kind: &Kind) -> Vec<Object> {
    let mut pairs: Vec<(u64, usize, usize)> = Vec::new();
    let limit = (kind.join_m / view.grid.cell_m).ceil() as usize;
    let boxes: Vec<[usize; 4]> = objects.iter().map(|object| bounds(&object.cells[0])).collect();
    for (a, box_a) in boxes.iter().enumerate() {
        for (b, box_b) in boxes.iter().enumerate().skip(a + 1) {
            let apart = |low: usize, high: usize| {
                box_a[low].saturating_sub(box_b[high]).max(box_b[low].saturating_sub(box_a[high]))
            };
            if apart(0, 1) <= limit && apart(2, 3) <= limit {
                let gap_m = gap(&objects[a].cells[0], &objects[b].cells[0]).sqrt() * view.grid.cell_m;
                if gap_m <= kind.join_m {
                    pairs.push(((gap_m * 1e6) as u64, a, b));
                }
            }
        }
    }
    pairs.sort_unstable();
    let mut sets = Sets::new(objects.len());
    for &(_, a, b) in &pairs {
        let (numbers, _) = sets.numbers();
        let of_both = |idx: &usize| numbers[*idx] == numbers[a] || numbers[*idx] == numbers[b];
        let corners = (0..objects.len()).filter(of_both).flat_map(|idx| &objects[idx].cells[0]);
        let centers: Vec<[f64; 2]> = corners.map(|&(row, col)| view.grid.center(row, col).into()).collect();
        let length_m = OrientedRectangle::around(&centers).map_or(0.0, |r| r.length_m) + view.grid.cell_m;
        if length_m <= kind.max_length_m {
            sets.union(a, b);
        }
    }
    let (numbers, n) = sets.numbers();
    let mut joined: Vec<Option<Object>> = (0..n).map(|_| None).collect();
    for (object, &number) in objects.into_iter().zip(&numbers) {
        match &mut joined[number as usize] {
            Some(whole) => whole.append(object),
            empty => *empty = Some(object),
        }
    }
    let mut joined: Vec<Object> = joined.into_iter().flatten().collect();
    joined.iter_mut().for_each(Object::sort);
    joined
}

/// Smallest and largest row, smallest and largest column.
fn bounds(cells: &[Cell]) -> [usize; 4] {
    cells.iter().fold([usize::MAX, 0, usize::MAX, 0], |[a, b, c, d], &(row, col)| {
        [a.min(row), b.max(row), c.min(col), d.max(col)]
    })
}

/// Smallest squared distance between cells of two objects.
fn gap(a: &[Cell], b: &[Cell]) -> f64 {
    let squared = |p: &Cell, q: &Cell| (p.0.abs_diff(q.0).pow(2) + p.1.abs_diff(q.1).pow(2)) as f64;
    a.iter().flat_map(|p| b.iter().map(move |q| squared(p, q))).fold(f64::INFINITY, f64::min)
}
