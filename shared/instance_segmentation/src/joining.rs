//! Joins the parts of a static object that is partly occluded, such as a car behind a fence.

use crate::object::{Object, united};
use crate::sets::Sets;
use crate::settings::Kind;
use crate::top_view::{Cell, TopView};
use geometry::OrientedRectangle;

/// Joins nearby parts, the nearest first, if the result has the size of an object of the class and no ground was
/// observed between them.
pub(crate) fn join(objects: Vec<Object>, view: &TopView, kind: &Kind) -> Vec<Object> {
    let mut pairs: Vec<(u64, usize, usize)> = Vec::new();
    let limit = (kind.join_m / view.grid.cell_m).ceil() as usize;
    // The diagonal of the largest object.
    let longest = (kind.max_length_m * 1.0_f64.hypot(MAX_WIDTH_SHARE) / view.grid.cell_m).ceil() as usize;
    let boxes: Vec<[usize; 4]> = objects.iter().map(|object| bounds(&object.footprint.all)).collect();
    for (a, box_a) in boxes.iter().enumerate() {
        for (b, box_b) in boxes.iter().enumerate().skip(a + 1) {
            let apart = |low: usize, high: usize| {
                box_a[low].saturating_sub(box_b[high]).max(box_b[low].saturating_sub(box_a[high]))
            };
            let extent = |low: usize, high: usize| box_a[high].max(box_b[high]) - box_a[low].min(box_b[low]);
            let is_near = apart(0, 1) <= limit && apart(2, 3) <= limit;
            if is_near
                && extent(0, 1) <= longest
                && extent(2, 3) <= longest
                && objects[a].motion.is_none()
                && objects[b].motion.is_none()
            {
                let (gap, from, to) = gap(&objects[a].footprint.all, &objects[b].footprint.all);
                let is_hidden = ground_between(from, to, view) <= MAX_GROUND_BETWEEN;
                if (gap as f64).sqrt() * view.grid.cell_m <= kind.join_m && is_hidden {
                    pairs.push((gap as u64, a, b));
                }
            }
        }
    }
    pairs.sort_unstable();
    let mut sets = Sets::new(objects.len());
    for &(_, a, b) in &pairs {
        let (numbers, _) = sets.numbers();
        let of_both = |idx: &usize| numbers[*idx] == numbers[a] || numbers[*idx] == numbers[b];
        let corners = (0..objects.len()).filter(of_both).flat_map(|idx| &objects[idx].footprint.all);
        let centers: Vec<[f64; 2]> = corners.map(|&(row, col)| view.grid.center(row, col).into()).collect();
        let whole = OrientedRectangle::around(&centers);
        let fits = |whole: &OrientedRectangle| {
            let [length_m, width_m] = [whole.length_m, whole.width_m].map(|side_m| side_m + view.grid.cell_m);
            length_m <= kind.max_length_m && width_m <= MAX_WIDTH_SHARE * kind.max_length_m
        };
        if whole.is_some_and(|whole| fits(&whole)) {
            sets.union(a, b);
        }
    }
    united(objects, &mut sets)
}

/// Largest share of the cells between two parts of one object in which ground was observed.
const MAX_GROUND_BETWEEN: f64 = 0.3;

/// Largest width of a joined object as a share of its largest length.
const MAX_WIDTH_SHARE: f64 = 0.5;

/// Share of the cells on the line between two cells in which ground was observed.
fn ground_between(a: Cell, b: Cell, view: &TopView) -> f64 {
    let n = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1)).max(1);
    let along = |from: usize, to: usize, step: usize| {
        (from as f64 + (to as f64 - from as f64) * step as f64 / n as f64).round() as usize
    };
    let n_ground = (1..n).filter(|&step| view.ground[(along(a.0, b.0, step), along(a.1, b.1, step))]).count();
    n_ground as f64 / (n - 1).max(1) as f64
}

/// Smallest and largest row, smallest and largest column.
fn bounds(cells: &[Cell]) -> [usize; 4] {
    cells.iter().fold([usize::MAX, 0, usize::MAX, 0], |[a, b, c, d], &(row, col)| {
        [a.min(row), b.max(row), c.min(col), d.max(col)]
    })
}

/// Smallest squared distance between cells of two objects, and these cells.
fn gap(a: &[Cell], b: &[Cell]) -> (usize, Cell, Cell) {
    let pairs =
        a.iter().flat_map(|p| b.iter().map(move |q| (p.0.abs_diff(q.0).pow(2) + p.1.abs_diff(q.1).pow(2), *p, *q)));
    pairs.min_by_key(|pair| pair.0).unwrap_or((usize::MAX, (0, 0), (0, 0)))
}
