//! The extremum over an element, two rows of the result at a time.

use crate::Level;
use crate::element::Shape;
use crate::high::High;
use crate::low::Low;
use crate::parts::Parts;
use crate::picks::Pick;

/// Row radius from which van Herk's three comparisons with their buffers cost less than one for each row.
const HIGH_RADIUS: usize = 5;

/// Rows of an image, or the last `span` of them: row `i` lies where row `i % span` does.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a, T> {
    pub(crate) pixels: &'a [T],
    pub(crate) cols: usize,
    pub(crate) span: usize,
}

impl<'a, T> Source<'a, T> {
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &'a [T] {
        let start = (row % self.span) * self.cols;
        &self.pixels[start..start + self.cols]
    }
}

/// One dilation or erosion under way.
pub(crate) enum Rows<T> {
    Low(Low<T>),
    High(High<T>),
    Parts(Parts<T>),
}

impl<T: Level> Rows<T> {
    pub(crate) fn new(shape: &Shape, (rows, cols): (usize, usize), neutral: T) -> Self {
        match shape {
            Shape::Rectangle { row_radius, col_radius } => {
                // A window that reaches past both ends sees the whole line already.
                let (row_radius, reach) = ((*row_radius).min(rows), (*col_radius).min(cols));
                if row_radius < HIGH_RADIUS {
                    Self::Low(Low::new(row_radius, reach, (rows, cols), neutral))
                } else {
                    Self::High(High::new(row_radius, reach, (rows, cols), neutral))
                }
            }
            Shape::Runs(runs) => Self::Parts(Parts::new(runs, (rows, cols), neutral)),
        }
    }

    /// How many rows above and below are asked for.
    pub(crate) fn reach(&self) -> usize {
        match self {
            Self::Low(low) => low.row_radius,
            Self::High(high) => high.row_radius,
            Self::Parts(parts) => parts.row_reach,
        }
    }

    /// Rows `first` and `first + 1` of the result, the second of which may be one too many; pairs are asked for in their order.
    /// `source` has the rows up to `first + 1 + reach` that the image has, and `2 reach + 2` in all.
    pub(crate) fn pair(&mut self, first: usize, source: Source<'_, T>, into: &mut [T], pick: impl Pick<T>) {
        let into: [&mut [T]; 2] = into.split_at_mut(source.cols).into();
        wide_loops::run(
            #[inline(always)]
            || match self {
                Self::Low(low) => low.pair(first, source, into, pick),
                Self::High(high) => high.pair(first, source, into, pick),
                Self::Parts(parts) => parts.pair(first, source, into, pick),
            },
        );
    }
}
