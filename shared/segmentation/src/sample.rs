//! Samples of the points of a submap, for facts that a part of the points shows as well as all.

/// Approximate number of examined points of a submap: examining all would read the whole submap once more.
const EXAMINED: usize = 100_000;

/// Every point with this step is examined. It is odd: points are ordered by firings of 2^n rings, and all rings must be examined.
pub(crate) fn sample_step(n_points: usize) -> usize {
    (n_points / EXAMINED) | 1
}
