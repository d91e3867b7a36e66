//! Flat structuring elements.

use std::collections::BTreeMap;

/// A flat structuring element: a set of offsets (row, column) from the origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element(pub(crate) Shape);

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// A rectangle with these radii.
    Rectangle { row_radius: usize, col_radius: usize },
    /// Any set, as runs in raster order.
    Runs(Vec<Run>),
}

/// Columns `first..=last` of one row, relative to the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Run {
    pub(crate) row: isize,
    pub(crate) first: isize,
    pub(crate) last: isize,
}

impl Element {
    /// A square of side `2 radius + 1`.
    pub fn square(radius: usize) -> Self {
        Self::rectangle(radius, radius)
    }
    /// A rectangle of `2 row_radius + 1` rows and `2 col_radius + 1` columns.
    pub fn rectangle(row_radius: usize, col_radius: usize) -> Self {
        Self(Shape::Rectangle { row_radius, col_radius })
    }
    /// A disc: all offsets of Euclidean length up to `radius`, pixels.
    pub fn disc(radius: usize) -> Self {
        let r = radius as isize;
        // Up to 2^26 the square root of a square is exact.
        let half_width = |row: isize| ((r * r - row * row) as f64).sqrt() as isize;
        let run = |row: isize| Run { row, first: -half_width(row), last: half_width(row) };
        Self(Shape::Runs((-r..=r).map(run).collect()))
    }
    /// A line from minus to plus (`rows`, `cols`), with one pixel for each step of the longer side.
    pub fn line(rows: isize, cols: isize) -> Self {
        let n = rows.unsigned_abs().max(cols.unsigned_abs()) as isize;
        // Rounded to the nearest, halves away from zero, so that the line is symmetric.
        let share = |t: isize, side: isize| (t as f64 * side as f64 / n.max(1) as f64).round() as isize;
        Self::from_offsets((-n..=n).map(|t| (share(t, rows), share(t, cols))))
    }
    /// An element with any offsets (row, column). Duplicates are ignored. With an empty element, dilation gives the
    /// lowest and erosion the highest value everywhere.
    pub fn from_offsets(offsets: impl IntoIterator<Item = (isize, isize)>) -> Self {
        let mut rows: BTreeMap<isize, Vec<isize>> = BTreeMap::new();
        for (row, col) in offsets {
            rows.entry(row).or_default().push(col);
        }
        let mut runs: Vec<Run> = Vec::new();
        for (row, mut cols) in rows {
            cols.sort_unstable();
            for col in cols {
                match runs.last_mut() {
                    Some(run) if run.row == row && col <= run.last + 1 => run.last = col,
                    _ => runs.push(Run { row, first: col, last: col }),
                }
            }
        }
        Self(Shape::Runs(runs))
    }
    /// The element reflected about the origin.
    #[must_use]
    pub fn reflected(&self) -> Self {
        match &self.0 {
            Shape::Rectangle { .. } => self.clone(),
            Shape::Runs(runs) => {
                let turned = runs.iter().rev().map(|run| Run { row: -run.row, first: -run.last, last: -run.first });
                Self(Shape::Runs(turned.collect()))
            }
        }
    }
}

/// Converts a radius to a square.
impl From<usize> for Element {
    fn from(radius: usize) -> Self {
        Self::square(radius)
    }
}

impl From<&Element> for Element {
    fn from(element: &Element) -> Self {
        element.clone()
    }
}
