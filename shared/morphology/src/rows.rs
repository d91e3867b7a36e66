//! Dilation or erosion by one element, two result rows at a time.

use crate::element::Shape;
use crate::high::High;
use crate::level::Level;
use crate::low::Low;
use crate::parts::Parts;
use crate::picks::Pick;
use crate::source::Source;

/// Row radius from which the algorithm of van Herk is faster than one comparison per row.
const HIGH_RADIUS: usize = 5;

/// State of one dilation or erosion.
pub(crate) enum Rows<T> {
    Low(Low<T>),
    High(High<T>),
    Parts(Parts<T>),
}

impl<T: Level> Rows<T> {
    pub(crate) fn new(shape: &Shape, (rows, cols): (usize, usize), neutral: T) -> Self {
        match shape {
            Shape::Rectangle { row_radius, col_radius } => {
                // A larger window than the image has no effect.
                let row_radius = (*row_radius).min(rows);
                let reach = (*col_radius).min(cols);
                if row_radius < HIGH_RADIUS {
                    Self::Low(Low::new(row_radius, reach, (rows, cols), neutral))
                } else {
                    Self::High(High::new(row_radius, reach, (rows, cols), neutral))
                }
            }
            Shape::Runs(runs) => Self::Parts(Parts::new(runs, (rows, cols), neutral)),
        }
    }

    /// Number of rows needed above and below.
    pub(crate) fn reach(&self) -> usize {
        match self {
            Self::Low(low) => low.row_radius,
            Self::High(high) => high.row_radius,
            Self::Parts(parts) => parts.row_reach,
        }
    }

    /// Writes rows `first` and `first + 1` of the result; the second may lie below the image. Pairs must be requested in order. `source`
    /// must have all rows of the image up to `first + 1 + reach`, and at least the last `2 reach + 2`.
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
