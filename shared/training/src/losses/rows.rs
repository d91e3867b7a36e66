//! Rows of tensors in memory.

use candle_core::{Layout, Result, bail};
use std::ops::Range;

/// Range of the numbers of a tensor in memory, and the length of its rows.
pub fn rows(layout: &Layout) -> Result<(Range<usize>, usize)> {
    let (_, n_classes) = layout.shape().dims2()?;
    match layout.contiguous_offsets() {
        Some((begin, end)) if n_classes > 0 => Ok((begin..end, n_classes)),
        _ => bail!("a loss of values {:?}: must be contiguous rows", layout.shape()),
    }
}
