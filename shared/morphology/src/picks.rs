//! Pixel-wise extrema of rows.

use crate::blocks::{block, block_mut, in_blocks};
use crate::level::Level;

/// Maximum or minimum.
pub(crate) trait Pick<T>: Fn(T, T) -> T + Copy {}
impl<T, F: Fn(T, T) -> T + Copy> Pick<T> for F {}

/// Extremum of `N` rows.
#[inline(always)]
pub(crate) fn pick_rows<T: Level, const N: usize>(into: &mut [T], rows: [&[T]; N], pick: impl Pick<T>) {
    in_blocks!(into.len(), pick_in_block(into, &rows, pick));
}

/// Extremum of `n >= 1` rows. Several rows are combined at once, so that intermediate results are read and written less often. Missing
/// rows are replaced by the first.
#[inline(always)]
pub(crate) fn pick_all<'a, T: Level + 'a>(
    into: &mut [T],
    n: usize,
    row: impl Fn(usize) -> &'a [T],
    pick: impl Pick<T>,
) {
    let row = |idx: usize| row(if idx < n { idx } else { 0 });
    match n {
        1 => into.copy_from_slice(&row(0)[..into.len()]),
        2 => pick_rows(into, [0, 1].map(row), pick),
        3 => pick_rows(into, [0, 1, 2].map(row), pick),
        6..=8 => return pick_rows(into, [0, 1, 2, 3, 4, 5, 6, 7].map(row), pick),
        _ => pick_rows(into, [0, 1, 2, 3, 4].map(row), pick),
    }
    for idx in (5..n).step_by(4) {
        let rows = [idx, idx + 1, idx + 2, idx + 3].map(row);
        in_blocks!(into.len(), pick_more_in_block(into, &rows, pick));
    }
}

/// Extrema of two sets of rows that share all rows but one.
#[inline(always)]
pub(crate) fn pick_pair<T: Level, const N: usize>(
    [first, second]: [&mut [T]; 2],
    ends: [&[T]; 2],
    common: [&[T]; N],
    pick: impl Pick<T>,
) {
    in_blocks!(first.len(), pick_pair_in_block(first, second, ends, &common, pick));
}

/// `into = pick(into, other)`.
#[inline(always)]
pub(crate) fn pick_into<T: Level>(into: &mut [T], other: &[T], pick: impl Pick<T>) {
    in_blocks!(into.len(), pick_more_in_block(into, &[other], pick));
}

#[inline(always)]
fn pick_in_block<T: Level, const N: usize>(start: usize, into: &mut [T], rows: &[&[T]], pick: impl Pick<T>) {
    *block_mut(into, start) = values_in_block::<T, N>(start, rows, pick);
}

#[inline(always)]
fn pick_pair_in_block<T: Level, const N: usize>(
    start: usize,
    first: &mut [T],
    second: &mut [T],
    ends: [&[T]; 2],
    common: &[&[T]],
    pick: impl Pick<T>,
) {
    let values = values_in_block::<T, N>(start, common, pick);
    for (into, end) in [first, second].into_iter().zip(ends) {
        let mut whole = values;
        pick_values(&mut whole, block(end, start), pick);
        *block_mut(into, start) = whole;
    }
}

/// Extremum of the rows and of the current content.
#[inline(always)]
fn pick_more_in_block<T: Level, const N: usize>(start: usize, into: &mut [T], rows: &[&[T]], pick: impl Pick<T>) {
    let mut values: [T; N] = *block(into, start);
    for row in rows {
        pick_values(&mut values, block(row, start), pick);
    }
    *block_mut(into, start) = values;
}

#[inline(always)]
fn values_in_block<T: Level, const N: usize>(start: usize, rows: &[&[T]], pick: impl Pick<T>) -> [T; N] {
    let mut values: [T; N] = *block(rows[0], start);
    for row in &rows[1..] {
        pick_values(&mut values, block(row, start), pick);
    }
    values
}

#[inline(always)]
fn pick_values<T: Level, const N: usize>(values: &mut [T; N], others: &[T; N], pick: impl Pick<T>) {
    for i in 0..N {
        values[i] = pick(values[i], others[i]);
    }
}
