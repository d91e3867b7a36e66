//! Columns of a cloud (`docs/reference/outputs.md`).

use super::{CloudPoint, Present};
use delivery::ply_kind;
use formats::ply::{Header, Kind};
use geometry::{Point3, Pose};
use messages::columns::{Column, ColumnField, FieldType, Presence};
use std::collections::BTreeMap;

/// The fields that become extra bytes of LAS records, in the order of the extra bytes, and their columns.
pub(crate) fn extra_fields(table: &'static [Column]) -> Vec<(&'static Column, &'static ColumnField)> {
    let fields = table.iter().flat_map(|column| column.fields.iter().map(move |field| (column, field)));
    let mut fields: Vec<_> = fields.filter(|(_, field)| field.extra_byte.is_some()).collect();
    fields.sort_by_key(|(_, field)| field.extra_byte.map(|extra| extra.place));
    fields
}

/// Offsets of the columns in a row.
pub(crate) struct Columns {
    present: Present,
    row_size: usize,
    coordinates: Kind,
    xyz: usize,
    lidar_xyz: usize,
    timestamp: usize,
    index_frame: usize,
    intensity: usize,
    ring: usize,
    dynamic: usize,
    lidar: Option<usize>,
    instance: Option<usize>,
    class: Option<usize>,
    /// Red, green and blue.
    color: Option<[usize; 3]>,
    /// Fields of [`extra_fields`].
    extra: Vec<ExtraColumn>,
    /// Motion of the points by the adjustment of a survey.
    correction: Option<Pose>,
}

/// A field of [`extra_fields`] in a row.
struct ExtraColumn {
    /// Its offset. `None` if the cloud lacks the column.
    at: Option<usize>,
    kind: FieldType,
    /// Value of points without this field.
    none: f64,
}

/// The shot of a row.
pub(crate) struct ScanLine {
    /// Number of the sweep.
    pub(crate) frame: u32,
    pub(crate) lidar: u8,
    /// Number of the laser.
    pub(crate) ring: u8,
}

impl Columns {
    /// The columns of a cloud. The error is the rule that its header violates. `table` has all columns that may be
    /// present.
    pub(crate) fn from_header(header: &Header, table: &'static [Column]) -> Result<Self, String> {
        let find = |name: &str| {
            let mut at = 0;
            for property in &header.properties {
                if property.name == name {
                    return Some((property.kind, at));
                }
                at += property.kind.size();
            }
            None
        };
        let optional = |name: &str, expected: Kind| match find(name) {
            Some((kind, _)) if kind != expected => {
                Err(format!("column `{name}` is {}, must be {}", kind.name(), expected.name()))
            }
            found => Ok(found.map(|(_, at)| at)),
        };
        let required =
            |name: &str, kind: Kind| optional(name, kind)?.ok_or_else(|| format!("the cloud has no column `{name}`"));
        // Columns that must be adjacent.
        let run_of = |names: &[&str], kind: Kind| {
            let first = required(names[0], kind)?;
            for (k, name) in names.iter().enumerate() {
                if required(name, kind)? != first + k * kind.size() {
                    return Err(format!("column `{name}` must follow `{}`", names[k - 1]));
                }
            }
            Ok(first)
        };
        let coordinates = match find("x") {
            Some((Kind::Double, _)) => Kind::Double,
            _ => Kind::Float,
        };
        let xyz = run_of(&["x", "y", "z"], coordinates)?;
        let lidar_xyz = run_of(&["x_lidar_position", "y_lidar_position", "z_lidar_position"], coordinates)?;
        let mut present = Vec::new();
        let mut offsets = BTreeMap::new();
        for column in table.iter().filter(|column| !column.fields.is_empty()) {
            let mut found = Vec::new();
            for field in column.fields {
                let at = optional(field.property, ply_kind(field.kind, coordinates))?;
                found.extend(at.map(|at| (field.name, at)));
            }
            // For the points themselves, the fields that are needed here are required below.
            if column.presence == Presence::Always || found.len() == column.fields.len() {
                present.push(column.name);
                offsets.extend(found);
            }
        }
        let offset = |name: &str| offsets.get(name).copied();
        let extra = |(_, field): (&Column, &ColumnField)| ExtraColumn {
            at: offset(field.name),
            kind: field.kind,
            none: field.none.unwrap_or(0.0),
        };
        Ok(Self {
            present: Present::new(table, present),
            row_size: header.row_size(),
            coordinates,
            xyz,
            lidar_xyz,
            timestamp: required("timestamp", Kind::Double)?,
            index_frame: required("index_frame", Kind::Int)?,
            intensity: required("intensity", Kind::UChar)?,
            ring: required("ring", Kind::UChar)?,
            dynamic: required("dynamic", Kind::UChar)?,
            lidar: offset("lidar"),
            instance: offset("instance"),
            class: offset("class"),
            color: match ["red", "green", "blue"].map(offset) {
                [Some(red), Some(green), Some(blue)] => Some([red, green, blue]),
                _ => None,
            },
            extra: extra_fields(table).into_iter().map(extra).collect(),
            correction: None,
        })
    }

    /// Moves all points of the cloud.
    pub(crate) fn corrected(self, correction: Option<Pose>) -> Self {
        Self { correction, ..self }
    }

    pub(crate) fn row_size(&self) -> usize {
        self.row_size
    }

    pub(crate) fn present(&self) -> Present {
        self.present.clone()
    }

    #[inline]
    pub(crate) fn scan_line(&self, row: &[u8]) -> ScanLine {
        let frame = i32::from_le_bytes(field(row, self.index_frame)) as u32;
        ScanLine { frame, lidar: self.lidar.map_or(0, |at| row[at]), ring: row[self.ring] }
    }

    /// The point of a row.
    #[inline]
    pub(crate) fn point(&self, row: &[u8]) -> CloudPoint {
        let coordinates = |at: usize| {
            let xyz = match self.coordinates {
                Kind::Double => std::array::from_fn(|k| f64::from_le_bytes(field(row, at + 8 * k))),
                _ => std::array::from_fn(|k| f64::from(f32::from_le_bytes(field(row, at + 4 * k)))),
            };
            self.correction.map_or(xyz, |correction| (correction * Point3::from(xyz)).coords.into())
        };
        let ScanLine { frame, lidar, ring } = self.scan_line(row);
        CloudPoint {
            xyz: coordinates(self.xyz),
            lidar_xyz: coordinates(self.lidar_xyz),
            time_s: f64::from_le_bytes(field(row, self.timestamp)),
            frame,
            intensity: row[self.intensity],
            ring,
            is_moving: row[self.dynamic] != 0,
            lidar,
            instance: self.instance.map_or(0, |at| i32::from_le_bytes(field(row, at)) as u32),
            class: self.class.map_or(0, |at| row[at]),
            rgb: self.color.map_or([0; 3], |at| at.map(|at| row[at])),
        }
    }

    /// Passes the bytes of field `place` of [`extra_fields`] in a LAS record to `put`.
    #[inline]
    pub(crate) fn put_extra(&self, place: usize, row: &[u8], mut put: impl FnMut(&[u8])) {
        let ExtraColumn { at, kind, none } = self.extra[place];
        match (kind, at) {
            (FieldType::U8, Some(at)) => put(&row[at..=at]),
            (FieldType::U8, None) => put(&[none as u8]),
            (FieldType::Share, Some(at)) => put(&[share(row, at)]),
            (FieldType::Share, None) => put(&[(none * 255.0) as u8]),
            (FieldType::U32 | FieldType::F32 | FieldType::Coordinate, Some(at)) => put(&row[at..at + 4]),
            (FieldType::U32, None) => put(&(none as u32).to_le_bytes()),
            (FieldType::F32 | FieldType::Coordinate, None) => put(&(none as f32).to_le_bytes()),
            (FieldType::F64, Some(at)) => put(&row[at..at + 8]),
            (FieldType::F64, None) => put(&none.to_le_bytes()),
        }
    }

    /// Field `place` of [`extra_fields`] as a number.
    #[inline]
    pub(crate) fn extra(&self, place: usize, row: &[u8]) -> f32 {
        let ExtraColumn { at, kind, none } = self.extra[place];
        let Some(at) = at else { return none as f32 };
        match kind {
            FieldType::U8 => f32::from(row[at]),
            FieldType::Share => f32::from(share(row, at)) / 255.0,
            FieldType::U32 => i32::from_le_bytes(field(row, at)) as u32 as f32,
            FieldType::F32 | FieldType::Coordinate => f32::from_le_bytes(field(row, at)),
            FieldType::F64 => f64::from_le_bytes(field(row, at)) as f32,
        }
    }
}

/// A share, 0 to 1, in steps of 1 / 255.
#[inline]
fn share(row: &[u8], at: usize) -> u8 {
    (f32::from_le_bytes(field(row, at)) * 255.0).round() as u8
}

/// `N` bytes of a row. [`Columns::from_header`] guarantees that they are inside the row.
#[inline]
fn field<const N: usize>(row: &[u8], at: usize) -> [u8; N] {
    row[at..at + N].try_into().expect("N bytes")
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::columns::COLUMNS;

    fn header() -> Header {
        let floats = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
        Header::new(floats.map(|name| (name, Kind::Float)).into_iter().chain([
            ("timestamp", Kind::Double),
            ("index_frame", Kind::Int),
            ("intensity", Kind::UChar),
            ("ring", Kind::UChar),
            ("dynamic", Kind::UChar),
        ]))
    }

    #[test]
    fn columns_of_other_types_are_refused_by_name() {
        let columns = |change: fn(&mut Header)| {
            let mut header = header();
            change(&mut header);
            let present = Columns::from_header(&header, COLUMNS)?.present();
            Ok::<_, String>(
                COLUMNS.iter().map(|column| column.name).filter(|name| present.has(name)).collect::<Vec<_>>(),
            )
        };
        assert_eq!(columns(|_| ()), Ok(vec!["points"]));
        let rule = columns(|header| header.properties[6].kind = Kind::Float).expect_err("refused");
        assert_eq!(rule, "column `timestamp` is float, must be double");
        let rule = columns(|header| header.properties.swap(1, 2)).expect_err("refused");
        assert_eq!(rule, "column `y` must follow `x`");
        let rule = columns(|header| drop(header.properties.remove(9))).expect_err("refused");
        assert_eq!(rule, "the cloud has no column `ring`");
    }

    #[test]
    fn fields_of_absent_columns_have_their_value_for_none() {
        let columns = Columns::from_header(&header(), COLUMNS).expect("is complete");
        let row = vec![7; columns.row_size()];
        for (place, (column, field)) in extra_fields(COLUMNS).into_iter().enumerate() {
            let mut bytes = Vec::new();
            columns.put_extra(place, &row, |part| bytes.extend_from_slice(part));
            assert_eq!(bytes.len(), field.kind.n_bytes(), "{}", field.name);
            let none = if field.name == "camera" { 255 } else { 0 };
            let expected = if column.name == "points" { 7 } else { none };
            assert!(bytes.iter().all(|byte| *byte == expected), "{}: {bytes:?}", field.name);
        }
    }
}
