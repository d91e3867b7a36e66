//! Loops over rows in blocks, for wide registers ([`wide_loops::run`]).

/// Pixels of a block: one register or a few.
pub(crate) const BLOCK: usize = 64;

/// Calls `work::<_, N>(start, ...)` for blocks `start..start + N` of a row of `n` pixels. The last two blocks may overlap, so `work` must
/// be idempotent. `N` is known at compile time, so loops over a block need no bounds checks and no remainder.
macro_rules! in_blocks {
    ($n:expr, $work:ident($($argument:expr),*)) => {
        let n: usize = $n;
        if n >= $crate::blocks::BLOCK {
            for start in (0..n).step_by($crate::blocks::BLOCK) {
                $work::<_, { $crate::blocks::BLOCK }>(start.min(n - $crate::blocks::BLOCK), $($argument),*);
            }
        } else {
            for start in 0..n {
                $work::<_, 1>(start, $($argument),*);
            }
        }
    };
}
pub(crate) use in_blocks;

/// A block of `N` pixels, starting at `start`.
#[inline(always)]
pub(crate) fn block<T, const N: usize>(row: &[T], start: usize) -> &[T; N] {
    row[start..start + N].try_into().expect("a slice of N pixels")
}

/// A mutable block of `N` pixels, starting at `start`.
#[inline(always)]
pub(crate) fn block_mut<T, const N: usize>(row: &mut [T], start: usize) -> &mut [T; N] {
    (&mut row[start..start + N]).try_into().expect("a slice of N pixels")
}
