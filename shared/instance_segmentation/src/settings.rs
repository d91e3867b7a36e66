//! Criteria for objects.

use messages::ClassId;

/// Conversion of cells to footprints, for all classes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootprintSettings {
    /// Dilation that joins the parts of an object, m.
    pub dilation_m: f64,
    /// Holes with fewer cells than this are filled.
    pub hole_cells: usize,
    /// Minimum fraction of the observed cells around an object that must have ground; 0 disables the filter.
    pub min_ground_around: f64,
    /// Points of a cell that are separated by at least this time belong to different objects, s; 0 ignores times.
    pub apart_s: f64,
}

/// A class with instances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// The class.
    pub class: ClassId,
    /// Maximum height of points above the ground, m.
    pub max_height_m: f32,
    /// Number of points in a submap with which any new object is accepted.
    pub min_points: usize,
    /// Minimum share of the expected points of a new object; 0 always requires `min_points`.
    pub min_share: f64,
    /// Least number of points of a new object.
    pub min_points_sparse: usize,
    /// Minimum mean class score of the points of a new object, 0 to 1.
    pub min_score: f64,
    /// Elevation peaks that each stand out by at least this height are two objects, m; 0 disables splitting.
    pub peak_m: f64,
    /// Parts up to this distance are joined, m; 0 disables joining.
    pub join_m: f64,
    /// Largest speed of a moving object, m/s; 0 for classes that do not move.
    pub max_speed_mps: f64,
    /// Length and height of a typical object, m.
    pub length_m: f64,
    /// See `length_m`.
    pub height_m: f64,
    /// Maximum length of an object that is joined from parts, m.
    pub max_length_m: f64,
}

impl Kind {
    /// Minimum number of points of a new object with this expected number. Without an expectation it is `min_points`.
    pub fn required_points(&self, expected: Option<f64>) -> usize {
        match expected {
            Some(expected) if self.min_share > 0.0 => {
                ((self.min_share * expected) as usize).max(self.min_points_sparse).min(self.min_points)
            }
            _ => self.min_points,
        }
    }
}
