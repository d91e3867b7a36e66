//! Loops compiled for the widest SIMD registers of the machine, selected at run time.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

/// Runs `work` compiled for the instruction set of this machine (AVX-512, AVX2 or SSE2). Auto-vectorized loops process 64, 32 or 16
/// bytes at a time. Multiplications and additions are not fused, so results do not depend on the register width.
///
/// `work` and all functions it calls must be `#[inline(always)]`: functions that are not inlined are compiled for the baseline
/// instruction set. Call this function, not [`pulp::Arch::dispatch`], with a closure: the `FnOnce` bound here makes the compiler
/// inline the closure.
///
/// ```
/// let (a, b) = ([1.0_f32; 1000], [2.0_f32; 1000]);
/// let mut sums = [0.0_f32; 1000];
/// wide_loops::run(
///     #[inline(always)]
///     || sums.iter_mut().zip(a.iter().zip(&b)).for_each(|(sum, (a, b))| *sum = a + b),
/// );
/// assert_eq!(sums, [3.0; 1000]);
/// ```
#[inline(always)]
pub fn run<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
