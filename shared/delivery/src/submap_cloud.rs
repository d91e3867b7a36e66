//! The cloud of a submap: the fields of Paris-CARLA-3D, then additional fields.

use crate::cloud_columns::{CloudColumn, header_of, point_columns, sort_by_place};
use crate::error::DeliveryError;
use crate::submap_geometry::SubmapGeometry;
use formats::ply::{Header, Kind, Row};
use messages::columns::{Column, ColumnField, FieldType};
use messages::pod::{bytes_from_rows, rows_in_bytes};
use messages::{
    InstanceTopic, Message, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, SpectraHeader, SubmapHeader, SubmapPoint,
};

/// A submap and its columns, as received.
#[derive(Clone, Copy)]
pub struct ReceivedSubmap<'a> {
    /// Number of the submap.
    pub seq: u64,
    /// Header of the submap.
    pub header: &'a SubmapHeader,
    /// Points of the submap.
    pub points: &'a [SubmapPoint],
    /// The received columns, in any order, except spectra.
    pub columns: &'a [ReceivedColumn<'a>],
    /// Header and words of the spectra, if there is such a column.
    pub spectra: Option<(&'a SpectraHeader, &'a [u32])>,
    /// Ids of moving instances, increasing ([`messages::InstanceHeader::moving`]); empty without such a column.
    pub moving: &'a [u32],
    /// Topics of the columns that were lost.
    pub lost: &'a [&'static str],
}

/// A column as received: a row for each point.
#[derive(Clone, Copy)]
pub struct ReceivedColumn<'a> {
    /// Its entry in the table, and its name.
    pub column: CloudColumn<'a>,
    /// Bytes of its rows.
    pub rows: &'a [u8],
}

impl<'a> ReceivedColumn<'a> {
    /// A column under its own name.
    pub fn new<T: Message>(column: &'a Column, rows: &'a [T::Row]) -> Self {
        Self { column: CloudColumn::new(column), rows: bytes_from_rows(rows) }
    }
}

impl<'a> ReceivedSubmap<'a> {
    /// The rows of the column of `T`, if it was received.
    pub(crate) fn rows<T: Message>(&self) -> Option<&'a [T::Row]> {
        let is_of_topic =
            |column: &&ReceivedColumn<'_>| column.column.renamed.is_none() && column.column.column.topic == T::TOPIC;
        rows_in_bytes(self.columns.iter().find(is_of_topic)?.rows)
    }
}

/// A checked submap with its columns.
pub(crate) struct SubmapColumns<'a> {
    pub(crate) seq: u64,
    pub(crate) points: &'a [SubmapPoint],
    pub(crate) geometry: SubmapGeometry,
    /// Type of coordinates in files.
    pub(crate) coordinates: Kind,
    /// Whether the points are from several LiDARs.
    has_lidars: bool,
    /// Ids of moving instances, increasing.
    moving: &'a [u32],
    /// Instance of each point; empty if none moves.
    instances: &'a [u32],
    /// Received columns in the order of the rows.
    columns: Vec<CloudColumn<'a>>,
    /// Their fields in the order of the rows.
    fields: Vec<ReceivedField<'a>>,
}

/// A field of a received column.
struct ReceivedField<'a> {
    rows: &'a [u8],
    row_bytes: usize,
    /// Bytes before the field in a row.
    offset: usize,
    kind: FieldType,
}

impl<'a> SubmapColumns<'a> {
    /// Checks the submap and its columns.
    pub(crate) fn new(received: &ReceivedSubmap<'a>, coordinates: Kind) -> Result<Self, DeliveryError> {
        let ReceivedSubmap { seq, header, points, moving, .. } = *received;
        let geometry = SubmapGeometry::new(seq, header, points)?;
        let mut columns = received.columns.to_vec();
        sort_by_place(&mut columns, |column| column.column);
        let mut fields = Vec::new();
        for &ReceivedColumn { column, rows } in &columns {
            let row_bytes = (column.column.layout)().row_bytes;
            if rows.len() != points.len() * row_bytes {
                let column = column.column.name;
                let n_bytes = rows.len();
                let n_points = points.len();
                return Err(DeliveryError::ColumnSize { column, seq, n_bytes, row_bytes, n_points });
            }
            for field in column.column.fields {
                let offset = column.column.offset_in_row(field);
                let received = ReceivedField { rows, row_bytes, offset, kind: field.kind };
                received.check(field, seq, points.len())?;
                fields.push(received);
            }
        }
        let columns = columns.iter().map(|column| column.column).collect();
        let instances = received.rows::<InstanceTopic>().filter(|_| !moving.is_empty()).unwrap_or_default();
        let has_lidars = header.n_lidars > 1;
        Ok(Self { seq, points, geometry, coordinates, has_lidars, moving, instances, columns, fields })
    }

    pub(crate) fn header(&self) -> Header {
        let columns = point_columns(self.has_lidars).chain(self.columns.iter().copied());
        header_of(self.coordinates, columns).comment(format!("REPLICA submap {}", self.seq))
    }

    /// Appends the fields of point `i`: first the fields of the columns `points` and `lidar` of the table, which come
    /// with the submap and need its poses, then the fields of the other columns.
    #[inline]
    pub(crate) fn encode(&self, i: usize, row: &mut Row<'_>) {
        let point = &self.points[i];
        let sweep = self.geometry.sweep(point);
        let lidar = sweep.lidar_position(point.offset_nanos);
        self.coordinates(self.geometry.position(point).coords.into(), row);
        self.coordinates(lidar.into(), row);
        let cosine = match point.incidence {
            POINT_INCIDENCE_UNKNOWN => -1.0,
            incidence => f32::from(incidence) / 254.0,
        };
        row.f32(cosine).f64(sweep.time_s(point.offset_nanos)).i32(sweep.seq);
        row.u8(point.intensity).u8(point.ring);
        row.f32(f32::from(point.azimuth) / 100.0).f32(f32::from(point.elevation) / 100.0);
        row.u8(u8::from(point.flags & POINT_DYNAMIC != 0 || self.is_on_moving_instance(i)));
        if self.has_lidars {
            row.u8(sweep.lidar);
        }
        for field in &self.fields {
            field.encode(i, row);
        }
    }

    #[inline]
    fn is_on_moving_instance(&self, i: usize) -> bool {
        self.instances.get(i).is_some_and(|id| *id != 0 && self.moving.binary_search(id).is_ok())
    }

    // Always inlined: otherwise the row is stored and loaded again for every field.
    #[inline(always)]
    pub(crate) fn coordinates(&self, xyz: [f64; 3], row: &mut Row<'_>) {
        let [x, y, z] = xyz;
        match self.coordinates {
            Kind::Double => row.f64(x).f64(y).f64(z),
            _ => row.f32(x as f32).f32(y as f32).f32(z as f32),
        };
    }
}

impl ReceivedField<'_> {
    /// Appends the value of point `i`.
    #[inline]
    fn encode(&self, i: usize, row: &mut Row<'_>) {
        let at = i * self.row_bytes + self.offset;
        match self.kind {
            FieldType::U8 => row.u8(self.rows[at]),
            FieldType::Share => row.f32(f32::from(self.rows[at]) / 255.0),
            FieldType::U32 => row.i32(i32::from_le_bytes(self.bytes(at))),
            FieldType::F32 | FieldType::Coordinate => row.f32(f32::from_le_bytes(self.bytes(at))),
            FieldType::F64 => row.f64(f64::from_le_bytes(self.bytes(at))),
        };
    }

    /// Checks that numbers fit the type `int` of PLY.
    fn check(&self, field: &ColumnField, seq: u64, n_points: usize) -> Result<(), DeliveryError> {
        if self.kind != FieldType::U32 {
            return Ok(());
        }
        let ids = (0..n_points).map(|i| u32::from_le_bytes(self.bytes(i * self.row_bytes + self.offset)));
        match ids.max().filter(|id| i32::try_from(*id).is_err()) {
            Some(id) => Err(DeliveryError::ExceedsInt { what: format!("{} of submap {seq}: id {id}", field.name) }),
            None => Ok(()),
        }
    }

    /// `N` bytes of the rows; [`SubmapColumns::new`] has checked the number of rows.
    #[inline]
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        self.rows[at..at + N].try_into().expect("N bytes")
    }
}
