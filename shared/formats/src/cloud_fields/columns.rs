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
    /// A pose of the sensor that the file states and that is not the identity, in the words of the file. It is not applied:
    /// programs differ in whether the points are in its frame.
    pub viewpoint: Option<String>,
    /// Points that the file flags.
    pub flags: PointFlags,
}

/// Numbers of points that a file flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointFlags {
    /// All points of the file.
    pub n_points: u64,
    /// Points flagged as withheld (deleted); they are not among the points of the cloud.
    pub n_withheld: u64,
    /// Points classified as noise.
    pub n_noise: u64,
}

impl PointFlags {
    /// The sums of two files.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            n_points: self.n_points + other.n_points,
            n_withheld: self.n_withheld + other.n_withheld,
            n_noise: self.n_noise + other.n_noise,
        }
    }

    /// Lines of a report.
    pub fn lines(self) -> Vec<String> {
        let Self { n_points, n_withheld, n_noise } = self;
        let withheld = format!("{n_withheld} of {n_points} points are flagged as withheld and left out");
        let noise =
            format!("{n_noise} of {n_points} points are classified as noise (7 or 18); they are kept as returns");
        let lines = [(n_withheld, withheld), (n_noise, noise)];
        lines.into_iter().filter(|(n, _)| *n > 0).map(|(_, line)| line).collect()
    }
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
