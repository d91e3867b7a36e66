//! Loops in the widest registers that the machine has.

/// Runs `work` compiled for the instructions of this machine: plain loops inside it take 32 or 64 bytes at a time. What it
/// calls must be inlined into it. Products and sums stay apart (no fused ones), so that the bytes are the same everywhere.
#[inline(always)]
pub(crate) fn wide<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
