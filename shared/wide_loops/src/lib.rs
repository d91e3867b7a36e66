//! Plain loops in the widest registers that the machine has.

/// Does `work` compiled for the instructions of this machine (AVX-512, AVX2 or SSE2): plain loops in it take 64, 32 or 16 bytes at
/// a time. Products and sums are not fused, so that the width does not show in the result.
///
/// `work` and all that it calls must be `#[inline(always)]`: what is not inlined is compiled for every machine. A closure that is
/// given to [`pulp::Arch::dispatch`] itself is no `FnOnce` but a `Fn`, whose one call is a function of its own and not inlined;
/// only the bound here makes it one.
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
