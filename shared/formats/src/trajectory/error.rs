//! Errors of trajectory files.

use geometry::Stamp;

/// Error of a line of a trajectory file that cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct TrajectoryError {
    /// Line, from 1.
    pub line: usize,
    /// Fault of the line.
    pub fault: PoseFault,
}

/// Fault of a line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PoseFault {
    /// The line has too few numbers.
    #[error("{found} numbers, expected {expected}")]
    TooFewNumbers {
        /// Numbers of the line.
        found: usize,
        /// Numbers of a pose.
        expected: usize,
    },
    /// The line continues after the last number.
    #[error("unexpected {found:?} after {expected} numbers")]
    ExtraField {
        /// The first excess field.
        found: String,
        /// Numbers of a pose.
        expected: usize,
    },
    /// A field is not a finite number.
    #[error("{found:?} is not a finite number")]
    Number {
        /// Text found.
        found: String,
    },
    /// A column is not a finite number.
    #[error("{column}: {found:?} is not a finite number")]
    Column {
        /// Name of the column.
        column: &'static str,
        /// Text found.
        found: String,
    },
    /// A stamp is not a time in seconds.
    #[error("{found:?} is not a time in seconds")]
    Seconds {
        /// Text found.
        found: String,
    },
    /// A stamp is not an integer number of ns.
    #[error("stamp: {found:?} is not an integer number of ns")]
    Nanos {
        /// Text found.
        found: String,
    },
    /// Stamps decrease.
    #[error("time {stamp} is before the time of the previous line")]
    TimeDecreases {
        /// Stamp of this line.
        stamp: Stamp,
    },
    /// A quaternion is not a unit quaternion.
    #[error("quaternion {x} {y} {z} {w} has norm {norm}, expected 1")]
    Quaternion {
        /// x component.
        x: f64,
        /// y component.
        y: f64,
        /// z component.
        z: f64,
        /// w component.
        w: f64,
        /// Norm of the quaternion.
        norm: f64,
    },
    /// A matrix is not a rotation.
    #[error("the left 3x3 matrix M is not a rotation: M M^T deviates by {deviation}, the determinant is {determinant}")]
    Rotation {
        /// Largest deviation of M M^T from the identity.
        deviation: f64,
        /// Determinant of M.
        determinant: f64,
    },
    /// A line has a different number of fields than the header line.
    #[error("{found} fields, the first line names {expected}")]
    FieldCount {
        /// Fields of the line.
        found: usize,
        /// Columns of the header line.
        expected: usize,
    },
    /// The header line lacks a column.
    #[error("the first line names no column `{0}`")]
    MissingColumn(&'static str),
    /// The header line has no time column.
    #[error("the first line names neither `stamp` (ns) nor `time_s`")]
    MissingTime,
}
