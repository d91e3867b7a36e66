//! Reads the points of a cloud in blocks.

use super::layout::Columns;
use super::text_points;
use crate::error::{At, ImportError};
use formats::ply::{Kind, PlyRows};
use std::path::Path;

/// Bytes of points that are read at a time.
const BLOCK_BYTES: usize = 1 << 22;

/// A point of a labeled cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CloudPoint {
    /// Position, m.
    pub position: [f64; 3],
    /// Position of the scanner, m.
    pub scanner: Option<[f64; 3]>,
    /// Time, s; 0 if unknown.
    pub time_s: f64,
    /// Intensity as stored in the file.
    pub intensity: f32,
    /// Cosine of ray and surface normal; NaN if unknown.
    pub cosine: f32,
    /// Class id of the data set; -1 if it is not an integer.
    pub label: i64,
    /// Instance; 0 = none.
    pub instance: u32,
    /// Red, green, blue; 0 if unknown.
    pub color: [u8; 3],
}

impl CloudPoint {
    /// The point in a row of values, whose positions are in `columns`. If the class column is beyond the row, the last
    /// value is used.
    pub fn from_row(columns: &Columns, values: &[f64]) -> Self {
        let value = |at: usize| values[at.min(values.len() - 1)];
        let triple = |at: [usize; 3]| at.map(value);
        let integer = |value: f64| if value.fract() == 0.0 && value.abs() < 9e15 { value as i64 } else { -1 };
        Self {
            position: triple(columns.position),
            scanner: columns.scanner.map(triple),
            time_s: columns.time.map_or(0.0, value),
            intensity: columns.intensity.map_or(0.0, |at| value(at) as f32),
            cosine: columns.cosine.map_or(f32::NAN, |at| value(at) as f32),
            label: integer(value(columns.class)),
            instance: columns.instance.map_or(0, |at| u32::try_from(integer(value(at))).unwrap_or(0)),
            color: columns.color.map_or([0; 3], |color| triple(color).map(|value| value as u8)),
        }
    }

    /// Whether position, scanner and time are finite numbers of a plausible size.
    pub fn is_valid(&self) -> bool {
        let near = |position: &[f64; 3]| position.iter().all(|value| value.abs() < 1e8);
        near(&self.position) && self.scanner.as_ref().is_none_or(near) && self.time_s.abs() < 9e9
    }
}

/// Passes all points of a file to `take`, in the order of the file.
pub(super) fn each_point(
    file: &Path,
    columns: &Columns,
    mut take: impl FnMut(&CloudPoint) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    if columns.layout.is_text() {
        return text_points::each_row(file, |values| take(&CloudPoint::from_row(columns, values)));
    }
    let rows = PlyRows::open(file).at(file)?;
    let kinds: Vec<Kind> = rows.header().properties.iter().map(|property| property.kind).collect();
    let row_bytes = rows.header().row_size();
    let block_rows = (BLOCK_BYTES / row_bytes.max(1)).max(1);
    let mut block = vec![0; block_rows.min(rows.len()) * row_bytes];
    let mut values = vec![0.0; kinds.len()];
    let mut first = 0;
    while first < rows.len() {
        let n = block_rows.min(rows.len() - first);
        let bytes = &mut block[..n * row_bytes];
        rows.read_into(first, bytes).at(file)?;
        for row in bytes.chunks_exact(row_bytes) {
            let mut at = 0;
            for (value, kind) in values.iter_mut().zip(&kinds) {
                *value = kind.value(&row[at..]);
                at += kind.size();
            }
            take(&CloudPoint::from_row(columns, &values))?;
        }
        first += n;
    }
    Ok(())
}

/// The first valid point of a file.
pub(super) fn first_point(file: &Path, columns: &Columns) -> Result<Option<CloudPoint>, ImportError> {
    let mut first = None;
    // This error only ends the reading early: the result is in the stored point.
    let read = each_point(file, columns, |point| {
        if point.is_valid() {
            first = Some(*point);
            return Err(ImportError::at(file, "the first point is found"));
        }
        Ok(())
    });
    if first.is_none() {
        read?;
    }
    Ok(first)
}
