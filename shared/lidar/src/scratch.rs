//! Returns of a part of a packet, in a fixed buffer.

use messages::SweepPoint;

/// Room for `N` returns.
#[derive(Clone, Debug)]
pub(crate) struct Scratch<const N: usize> {
    pub(crate) returns: [SweepPoint; N],
    pub(crate) len: usize,
}

impl<const N: usize> Default for Scratch<N> {
    fn default() -> Self {
        Self { returns: [SweepPoint::default(); N], len: 0 }
    }
}

impl<const N: usize> Scratch<N> {
    /// The returns.
    pub(crate) fn returns(&self) -> &[SweepPoint] {
        &self.returns[..self.len]
    }

    /// Appends a return. `false` if there is no room.
    #[inline(always)]
    pub(crate) fn push(&mut self, point: SweepPoint) -> bool {
        let Some(slot) = self.returns.get_mut(self.len) else { return false };
        *slot = point;
        self.len += 1;
        true
    }
}
