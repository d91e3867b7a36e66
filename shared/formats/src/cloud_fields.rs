//! What the fields of clouds mean, for all formats: PCD, PLY, LAS, `PointCloud2`.
//!
//! | idea | module |
//! |---|---|
//! | names and synonyms of the fields | `names` |
//! | types of the values, numbers as text | `values` |
//! | unit and origin of point times | `times` |
//! | rings: numbers of the beams, from the lowest | `beams` |
//! | one scale of the intensities of a recording | `intensity` |
//! | map coordinates | `coordinates` |
//! | the points of a file as columns, and the form of all files of a recording | `columns`, `form` |
//!
//! A format gives a [`RawCloud`]. [`FormBuilder`] determines the [`CloudForm`] of a recording from a few of its clouds, evenly spaced
//! by [`sampled`]. [`CloudForm::fired`] then gives the points of each cloud. The form belongs to the recording and never to
//! a sweep: a unit, a scale or an origin that differs between sweeps would move points or let intensities flicker.

mod beams;
mod columns;
mod coordinates;
mod form;
mod intensity;
mod names;
mod times;
mod values;

pub use beams::{Elevations, Rings};
pub use columns::{Column, PointFlags, RawCloud};
pub use coordinates::{CoordinateFault, MapOrigin};
pub use form::{CloudForm, FieldFault, FormBuilder};
pub use intensity::{IntensitySample, IntensityScale};
pub use names::Field;
pub use times::TimeForm;
pub use values::{ValueType, number};

/// Number of clouds from which the form of a recording is determined. The first revolution of a recording is often
/// incomplete.
pub const EXAMINED: usize = 8;

/// Up to [`EXAMINED`] items, evenly spaced, the first one included.
pub fn sampled<T>(items: &[T]) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(EXAMINED).max(1))
}
