//! Joins the parts of a static object that is partly occluded, such as a car behind a fence.

use crate::object::{Object, united};
use crate::sets::Sets;
use crate::settings::Kind;
use crate::top_view::{Cell, TopView};
use geometry::OrientedRectangle;

/// Joins nearby parts, the nearest first, if the result has the size of an object of the class and no ground was
/// observed between them.
pub(crate) fn join(objects: Vec<Object>, view: &TopView, kind: &Kind) -> Vec<Object> {
    let mut pairs: Vec<NearPair> = Vec::new();
    let limit = (kind.join_m / view.grid.cell_m).ceil() as usize;
    // The diagonal of the largest object.
    let longest = (kind.max_length_m * 1.0_f64.hypot(MAX_WIDTH_SHARE) / view.grid.cell_m).ceil() as usize;
    let boxes: Vec<Bounds> = objects.iter().map(|object| bounds(&object.footprint.all)).collect();
    for (a, box_a) in boxes.iter().enumerate() {
        for (b, box_b) in boxes.iter().enumerate().skip(a + 1) {
            let apart = |[low_a, high_a]: [usize; 2], [low_b, high_b]: [usize; 2]| {
                low_a.saturating_sub(high_b).max(low_b.saturating_sub(high_a))
            };
            let extent =
                |[low_a, high_a]: [usize; 2], [low_b, high_b]: [usize; 2]| high_a.max(high_b) - low_a.min(low_b);
            let is_near = apart(box_a.rows, box_b.rows) <= limit && apart(box_a.cols, box_b.cols) <= limit;
            if is_near
                && extent(box_a.rows, box_b.rows) <= longest
                && extent(box_a.cols, box_b.cols) <= longest
                && objects[a].motion.is_none()
                && objects[b].motion.is_none()
            {
                let Gap { squared, from, to } = gap(&objects[a].footprint.all, &objects[b].footprint.all);
                let is_hidden = ground_between(from, to, view) <= MAX_GROUND_BETWEEN;
                if (squared as f64).sqrt() * view.grid.cell_m <= kind.join_m && is_hidden {
                    pairs.push(NearPair { squared_gap: squared as u64, a, b });
                }
            }
        }
    }
    pairs.sort_unstable();
    let mut sets = Sets::new(objects.len());
    for &NearPair { a, b, .. } in &pairs {
        let numbers = sets.numbers().by_member;
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

/// Two objects that may be one; ordered by their gap.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct NearPair {
    squared_gap: u64,
    a: usize,
    b: usize,
}

/// Smallest and largest row and column.
#[derive(Clone, Copy)]
struct Bounds {
    rows: [usize; 2],
    cols: [usize; 2],
}

fn bounds(cells: &[Cell]) -> Bounds {
    let mut rows = [usize::MAX, 0];
    let mut cols = [usize::MAX, 0];
    for &(row, col) in cells {
        rows = [rows[0].min(row), rows[1].max(row)];
        cols = [cols[0].min(col), cols[1].max(col)];
    }
    Bounds { rows, cols }
}

/// Shortest distance between cells of two objects.
struct Gap {
    /// Square of the distance, in cells.
    squared: usize,
    from: Cell,
    to: Cell,
}

fn gap(a: &[Cell], b: &[Cell]) -> Gap {
    let gaps = a.iter().flat_map(|&from| b.iter().map(move |&to| gap_of_cells(from, to)));
    gaps.min_by_key(|gap| gap.squared).unwrap_or(Gap { squared: usize::MAX, from: (0, 0), to: (0, 0) })
}

fn gap_of_cells(from: Cell, to: Cell) -> Gap {
    Gap { squared: from.0.abs_diff(to.0).pow(2) + from.1.abs_diff(to.1).pow(2), from, to }
}
