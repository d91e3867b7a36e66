//! The input of a network on points.

use crate::SegmentationError;
use candle_core::Tensor;
use neighbors::LIMIT_M;
use std::ops::Range;

/// Point clouds, stored one after another.
#[derive(Clone, Debug)]
pub struct PointBatch {
    positions: Vec<[f32; 3]>,
    lengths: Vec<usize>,
}

impl PointBatch {
    /// Creates a batch from positions in m, near the origin, and the number of points of each cloud.
    ///
    /// # Errors
    /// If a cloud is empty, the lengths do not add up, or a coordinate is not a number.
    pub fn new(positions: Vec<[f32; 3]>, lengths: Vec<usize>) -> Result<Self, SegmentationError> {
        let total = lengths.iter().try_fold(0_usize, |sum, length| sum.checked_add(*length));
        if total != Some(positions.len()) || lengths.contains(&0) || positions.len() > u32::MAX as usize >> 6 {
            return Err(SegmentationError::Settings(format!(
                "clouds of {} points for {} positions; each cloud needs a point, together at most 2^26",
                total.unwrap_or(usize::MAX),
                positions.len()
            )));
        }
        let is_invalid = |position: &[f32; 3]| !position.iter().all(|v| v.abs() <= LIMIT_M);
        if let Some(point) = positions.iter().position(is_invalid) {
            let position = positions[point];
            return Err(SegmentationError::Position { point, position });
        }
        Ok(Self { positions, lengths })
    }
    /// Positions of all clouds, m.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }
    /// Number of points of each cloud.
    pub fn lengths(&self) -> &[usize] {
        &self.lengths
    }
    /// Range of point numbers of each cloud.
    pub fn clouds(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        ranges(&self.lengths)
    }
    /// The positions as a tensor `(points, 3)`.
    pub fn positions_tensor(&self) -> Result<Tensor, SegmentationError> {
        let values = self.positions.as_flattened().to_vec();
        Ok(kernels::points::tensor(values, (self.positions.len(), 3))?)
    }
}

/// Ranges of these lengths, one after another.
pub(super) fn ranges(lengths: &[usize]) -> impl Iterator<Item = Range<usize>> + '_ {
    lengths.iter().scan(0, |start, length| {
        *start += length;
        Some(*start - length..*start)
    })
}
