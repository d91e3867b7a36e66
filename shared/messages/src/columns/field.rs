//! One field of a column, from the row of its topic to the files.

use serde::Serialize;

/// One number of every point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColumnField {
    /// Name in fields of CloudCompare, pictures and the viewer; in extra bytes of LAS records, see
    /// [`ColumnField::extra_byte_name`].
    pub name: &'static str,
    /// Name of the property in PLY clouds: the name in Paris-CARLA-3D, if it has one.
    pub property: &'static str,
    /// Name of the field in the row of the topic; empty if the row is a plain number.
    pub row_field: &'static str,
    /// Type in the row and in files.
    pub kind: FieldType,
    /// Unit of the value in files; empty for values without a unit.
    pub unit: &'static str,
    /// Value of points without one. `None`: every point has a value.
    pub none: Option<f64>,
    /// The field after the standard ones of a LAS record. `None`: LAS has a standard field for it, or the file omits it.
    pub extra_byte: Option<ExtraByte>,
    /// How pictures show it.
    pub shown: Shown,
    /// Names of the values.
    pub names: Option<NamedIds>,
    /// Content of the field, in plain words.
    pub description: &'static str,
}

/// Type of a field: in the row of the topic, in PLY clouds and in extra bytes of LAS records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldType {
    /// f32, m. PLY: `float` or `double`, as set in `[export] coordinates`.
    Coordinate,
    /// f64. PLY: `double`.
    F64,
    /// f32. PLY: `float`. LAS: f32.
    F32,
    /// u32 below 2^31. PLY: `int`, as readers skip `uint`. LAS: u32.
    U32,
    /// u8. PLY: `uchar`. LAS: u8.
    U8,
    /// u8, 0 to 255 for 0 to 1. PLY: `float`, 0 to 1. LAS: u8 with the scale 1 / 255.
    Share,
}

impl FieldType {
    /// Bytes of a value in the row of a topic and in extra bytes of LAS records.
    pub const fn n_bytes(self) -> usize {
        match self {
            Self::U8 | Self::Share => 1,
            Self::Coordinate | Self::F32 | Self::U32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A field after the standard fields of a LAS record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ExtraByte {
    /// Place among the extra bytes of all columns. A new column takes the next number, so that records keep their layout.
    pub place: u8,
    /// Its description in the file, which keeps the first 32 characters.
    pub description: &'static str,
}

/// How pictures show a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shown {
    /// Not shown.
    No,
    /// The first of red, green and blue, which are shown unchanged.
    Color,
    /// A color for each named value: [`ColumnField::names`].
    Names,
    /// A different color for each number; gray for none.
    Ids,
    /// Points with a value other than 0 are marked.
    Flag,
    /// A color ramp from the smallest to the largest value.
    Ramp,
    /// A color ramp of the square root, for fields in which a few values are much larger than most.
    RootRamp,
}

/// Names of the values of an id field.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct NamedIds {
    /// Raised when an id changes its meaning.
    pub version: u64,
    /// The names by id, from 0 on.
    #[serde(skip)]
    pub names: fn() -> Vec<&'static str>,
}

impl PartialEq for NamedIds {
    fn eq(&self, other: &Self) -> bool {
        self.version == other.version && (self.names)() == (other.names)()
    }
}

impl ColumnField {
    /// A field with the same name everywhere, without unit, value for none and extra byte.
    pub const fn new(name: &'static str, kind: FieldType, description: &'static str) -> Self {
        Self {
            name,
            property: name,
            row_field: name,
            kind,
            unit: "",
            none: None,
            extra_byte: None,
            shown: Shown::No,
            names: None,
            description,
        }
    }
    /// Sets the name in PLY clouds.
    #[must_use]
    pub const fn property(self, property: &'static str) -> Self {
        Self { property, ..self }
    }
    /// Sets the name in the row of the topic; empty for a row that is a plain number.
    #[must_use]
    pub const fn row_field(self, row_field: &'static str) -> Self {
        Self { row_field, ..self }
    }
    /// Sets the unit.
    #[must_use]
    pub const fn unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }
    /// Sets the value of points without one.
    #[must_use]
    pub const fn none(self, none: f64) -> Self {
        Self { none: Some(none), ..self }
    }
    /// Name in extra bytes of LAS records. Readers in Python make attributes of the fields, so no keyword of Python is a name.
    pub fn extra_byte_name(&self) -> &'static str {
        match self.name {
            "class" => "class_id",
            name => name,
        }
    }
    /// Adds an extra byte of LAS records.
    #[must_use]
    pub const fn extra_byte(self, place: u8, description: &'static str) -> Self {
        Self { extra_byte: Some(ExtraByte { place, description }), ..self }
    }
    /// Sets how pictures show the field.
    #[must_use]
    pub const fn shown(self, shown: Shown) -> Self {
        Self { shown, ..self }
    }
    /// Adds names of the values; pictures then show a color for each name.
    #[must_use]
    pub const fn named(self, version: u64, names: fn() -> Vec<&'static str>) -> Self {
        Self { names: Some(NamedIds { version, names }), shown: Shown::Names, ..self }
    }
}
