//! Loops in the widest registers that the machine has.

pub(crate) use pulp::NullaryFnOnce as Work;

/// Does the work compiled for the instructions of this machine: plain loops in it take 32 or 64 bytes at a time. All that it
/// calls must be `#[inline(always)]`, its own `call` too, and a loop's arrays must be those of one or two structs, of constant
/// length: only then is it certain at compile time that they do not overlap. Products and sums are not fused, so the width does not show in
/// the result.
#[inline(always)]
pub(crate) fn wide<W: Work>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(work)
}
