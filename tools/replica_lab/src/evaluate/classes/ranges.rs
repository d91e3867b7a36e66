//! Scores by distance from the LiDAR.

use super::seven;
use messages::ClassId;
use scores::Confusion;

/// Ends of the ranges, m; the last range is unbounded.
const ENDS_M: [f32; 3] = [10.0, 20.0, 40.0];

/// Names of the ranges.
pub const NAMES: [&str; 4] = ["0-10 m", "10-20 m", "20-40 m", "beyond 40 m"];

/// The points of one range.
#[derive(Clone)]
pub struct OfRange {
    /// Confusion of the classes of this project.
    pub classes: Confusion,
    /// Confusion of the seven classes.
    pub seven: Confusion,
}

impl Default for OfRange {
    fn default() -> Self {
        Self { classes: Confusion::new(ClassId::ALL.len()), seven: Confusion::new(seven::NAMES.len()) }
    }
}

/// Index of the range of a distance. NaN is beyond all ends.
pub fn index_for(range_m: f32) -> usize {
    ENDS_M.iter().position(|end_m| range_m < *end_m).unwrap_or(ENDS_M.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_contain_their_begin_and_not_their_end() {
        let found = [0.0, 9.99, 10.0, 39.9, 40.0, f32::NAN].map(index_for);
        assert_eq!(found, [0, 0, 1, 2, 3, 3]);
    }
}
