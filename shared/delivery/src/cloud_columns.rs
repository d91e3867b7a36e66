//! The columns of a cloud: its properties and header lines, from the table of columns.

use crate::frame::odometry_line;
use formats::ply::{Header, Kind, Property};
use messages::columns::{COLUMNS, Column, ColumnField, FieldType, Presence};

/// A column of clouds.
#[derive(Clone, Copy, Debug)]
pub struct CloudColumn<'a> {
    /// Its entry in the table.
    pub column: &'a Column,
    /// Name of an additional topic of the column's type, such as `class_b`: its properties get this name instead.
    pub renamed: Option<&'a str>,
}

/// Fields of the points of a cloud in addition to position, time, angles and intensity.
#[derive(Clone, Debug)]
pub struct CloudFields<'a> {
    /// Type of coordinates.
    pub coordinates: Kind,
    /// Columns with their own topics, in any order.
    pub columns: Vec<CloudColumn<'a>>,
}

impl CloudFields<'_> {
    /// Fields of a run with all stages and their default settings.
    pub fn for_default_run() -> Self {
        let columns = COLUMNS.iter().filter(|column| column.has_own_topic() && column.presence == Presence::Default);
        Self { coordinates: Kind::Float, columns: columns.map(CloudColumn::new).collect() }
    }
}

impl<'a> CloudColumn<'a> {
    /// A column under its own name.
    pub fn new(column: &'a Column) -> Self {
        Self { column, renamed: None }
    }

    /// Name of the property of a field.
    fn property(&self, number: usize, field: &ColumnField) -> String {
        match self.renamed {
            None => field.property.to_owned(),
            Some(topic) if number == 0 => topic.to_owned(),
            Some(topic) => format!("{topic}_{}", field.property),
        }
    }

    /// The `obj_info` lines of the column.
    fn header_lines(&self) -> Vec<String> {
        if let (Some(topic), Some(first)) = (self.renamed, self.column.fields.first()) {
            return vec![format!("{topic} of the table of {}", first.property)];
        }
        let named = self.column.fields.iter().filter_map(|field| Some((field, field.names?)));
        let tables =
            named.map(|(field, ids)| format!("{} table {}: {}", field.property, ids.version, (ids.names)().join(" ")));
        self.column.header_lines.iter().map(|line| (*line).to_owned()).chain(tables).collect()
    }

    /// Its position in a row: renamed columns come after the others.
    fn place(&self) -> (bool, u8) {
        (self.renamed.is_some(), self.column.place)
    }
}

/// The columns of the points themselves.
pub(crate) fn point_columns<'a>(has_lidars: bool) -> impl Iterator<Item = CloudColumn<'a>> {
    let is_present =
        move |column: &&Column| !column.has_own_topic() && (has_lidars || column.presence != Presence::SeveralLidars);
    COLUMNS.iter().filter(is_present).map(CloudColumn::new)
}

/// Sorts columns by their positions in a row. Columns with equal positions keep their order.
pub(crate) fn sort_by_place<'a, T>(columns: &mut [T], column: impl Fn(&T) -> CloudColumn<'a>) {
    columns.sort_by_key(|entry| column(entry).place());
}

/// The header of a cloud with these columns in this order.
pub(crate) fn header_of<'a>(coordinates: Kind, columns: impl IntoIterator<Item = CloudColumn<'a>>) -> Header {
    let mut header = Header::default().info(odometry_line());
    for column in columns {
        for (number, field) in column.column.fields.iter().enumerate() {
            let kind = ply_kind(field.kind, coordinates);
            header.properties.push(Property::new(column.property(number, field), kind));
        }
        header.infos.extend(column.header_lines());
    }
    header
}

/// Type of the property of a field in clouds with coordinates of this type.
pub fn ply_kind(kind: FieldType, coordinates: Kind) -> Kind {
    match kind {
        FieldType::Coordinate => coordinates,
        FieldType::F64 => Kind::Double,
        FieldType::F32 | FieldType::Share => Kind::Float,
        FieldType::U32 => Kind::Int,
        FieldType::U8 => Kind::UChar,
    }
}
