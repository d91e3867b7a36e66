//! Reduces lines of charts to a visible number of points.

/// Largest number of points of a line: more than a chart can show.
const MAX_POINTS: usize = 4000;

/// Every n-th point and the last, so that there are at most `MAX_POINTS` and one.
pub fn thinned(points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let stride = points.len().div_ceil(MAX_POINTS).max(1);
    let last = points.len().saturating_sub(1);
    let keep = |i: usize| i.is_multiple_of(stride) || i == last;
    points.into_iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, point)| point).collect()
}
