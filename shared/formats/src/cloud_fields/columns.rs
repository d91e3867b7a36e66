//! The points of a file as columns.

use super::ValueType;

/// A field of all points.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in the file.
    pub name: String,
    /// Type in the file.
    pub value_type: ValueType,
    /// One value for each point.
    pub values: Vec<f64>,
}

/// The points of a file. All columns have the same length.
#[derive(Clone, Debug, PartialEq)]
pub struct RawCloud {
    /// Coordinates as stored, m.
    pub positions: Vec<[f64; 3]>,
    /// Least precise type of a coordinate in the file.
    pub position_type: ValueType,
    /// Intensities, if present.
    pub intensities: Option<Column>,
    /// Numbers of the beams, if present.
    pub beams: Option<Column>,
    /// Times, if present.
    pub times: Option<Column>,
}

impl RawCloud {
    /// Whether a point is a return: missing returns are NaN or 0 0 0.
    pub fn is_return(&self, index: usize) -> bool {
        let [x, y, z] = self.positions[index];
        [x, y, z].iter().all(|value| value.is_finite()) && [x, y, z] != [0.0; 3]
    }

    /// Smallest and largest time, of all points or of the returns only. `None` without times.
    pub(super) fn time_range(&self, only_returns: bool) -> Option<[f64; 2]> {
        let values = &self.times.as_ref()?.values;
        let used = values.iter().enumerate().filter(|(index, _)| !only_returns || self.is_return(*index));
        let found = |range: Option<[f64; 2]>, (_, time): (usize, &f64)| {
            let [low, high] = range.unwrap_or([*time, *time]);
            Some([low.min(*time), high.max(*time)])
        };
        used.fold(None, found)
    }
}
