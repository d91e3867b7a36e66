//! Rows in blocks for the widest registers that the machine has. What stands in `wide!` is compiled for the instructions of this
//! machine; what it calls must be `#[inline(always)]`: what stays a function of its own is compiled for the oldest machine.

/// The value of an expression, worked out with all instructions that this machine has.
macro_rules! wide {
    ($work:expr) => {{
        let once = $crate::blocks::Once;
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                // A closure that could be called again is called through a function of its own.
                let _moved = once;
                $work
            },
        )
    }};
}
pub(crate) use wide;

/// Something that can be given away only once.
pub(crate) struct Once;

/// Pixels of a row that are worked on at once: a register or a few of them.
pub(crate) const BLOCK: usize = 64;

/// `work::<_, N>(start, ...)` for pixels `start..start + N` of a row of `n`, over and over until all are done. The last blocks may
/// overlap, so doing it twice must do no harm. The compiler knows the length of a block: a loop over it has no checks and no
/// rest.
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

/// `N` pixels from `start` on.
#[inline(always)]
pub(crate) fn block<T, const N: usize>(row: &[T], start: usize) -> &[T; N] {
    row[start..start + N].try_into().expect("a slice of N pixels")
}

/// `N` pixels from `start` on.
#[inline(always)]
pub(crate) fn block_mut<T, const N: usize>(row: &mut [T], start: usize) -> &mut [T; N] {
    (&mut row[start..start + N]).try_into().expect("a slice of N pixels")
}
