//! Loops compiled for the widest vector registers of the machine, selected at run time.
//!
//! A release binary is compiled for the oldest supported processor, which has registers of 16 bytes. A plain loop over slices in
//! [`run`] is compiled several times, for AVX-512, AVX2 and SSE2, and the program selects one when it runs. So hot loops of
//! `morphology`, `neighbors` and `kernels` use the machine without `unsafe` code and without a second binary.
//!
//! A result never depends on the register width: multiplications and additions are not fused, and the compiler does not reorder sums of
//! floating-point numbers. A loop that needs fused multiply-adds or its own register tiles uses `pulp` directly, as `kernels::images`
//! does.
//!
//! This crate has one function and never gets a second way to select instructions. It must never read an environment variable or a
//! setting that changes the selection: the same binary gives the same bytes on every machine.
//!
//! Where to start reading: [`run`] and its example; a typical caller is `morphology/src/flat.rs`.

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
