//! Extra bytes of the records and their descriptions.

use super::vlr::{Vlr, padded};
use crate::cloud::{Present, extra_fields};
use messages::columns::{ColumnField, ExtraByte, FieldType};

/// The content of an extra field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ExtraField {
    /// A field of the table of columns, and its index in [`extra_fields`].
    Column(usize, &'static ColumnField),
    /// Reflectance of the band of this number.
    Band(usize),
}

/// Fields after the point format, in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExtraBytes {
    pub(crate) fields: Vec<ExtraField>,
    bands: Vec<String>,
}

/// Type, unit and no-data value in the description of a field.
struct Description<'a> {
    name: &'a str,
    text: &'a str,
    data_type: u8,
    no_data: Option<[u8; 8]>,
    scale: Option<f64>,
}

impl ExtraBytes {
    /// Fields for the columns of the clouds. `bands` are the names of the bands to write.
    pub(crate) fn new(present: &Present, bands: &[String]) -> Self {
        let columns = extra_fields(present.table()).into_iter().enumerate();
        let columns = columns.filter(|(_, (column, _))| present.has(column.name));
        let columns = columns.map(|(place, (_, field))| ExtraField::Column(place, field));
        Self { fields: columns.chain((0..bands.len()).map(ExtraField::Band)).collect(), bands: bands.to_vec() }
    }

    /// Bytes of all fields.
    pub(crate) fn n_bytes(&self) -> usize {
        self.fields.iter().map(|field| field.n_bytes()).sum()
    }

    /// Bytes before the field of a column. `None` if records do not have it.
    pub(crate) fn offset(&self, name: &str) -> Option<usize> {
        let has_name = |field: &ExtraField| matches!(field, ExtraField::Column(_, column) if column.name == name);
        let k = self.fields.iter().position(has_name)?;
        Some(self.fields[..k].iter().map(|field| field.n_bytes()).sum())
    }

    /// The record that describes the fields.
    pub(crate) fn vlr(&self) -> Vlr {
        let data = self.fields.iter().flat_map(|field| field.description(&self.bands).bytes()).collect();
        Vlr { user: "LASF_Spec", id: 4, description: "extra bytes", data }
    }
}

impl ExtraField {
    const fn n_bytes(self) -> usize {
        match self {
            Self::Column(_, field) => field.kind.n_bytes(),
            Self::Band(_) => 4,
        }
    }

    fn description(self, bands: &[String]) -> Description<'_> {
        match self {
            Self::Column(_, field) => {
                let text = field.extra_byte.map_or("", |ExtraByte { description, .. }| description);
                // Types: 1 = u8, 5 = u32, 9 = f32, 10 = f64.
                let (data_type, scale) = match field.kind {
                    FieldType::U8 => (1, None),
                    FieldType::Share => (1, Some(1.0 / 255.0)),
                    FieldType::U32 => (5, None),
                    FieldType::F32 | FieldType::Coordinate => (9, None),
                    FieldType::F64 => (10, None),
                };
                // Ids keep their number for "no id", which is an ordinary value; only measured values have a no-data
                // value.
                let no_data = field.none.filter(|_| data_type > 8).map(f64::to_le_bytes);
                Description { name: field.extra_byte_name(), text, data_type, no_data, scale }
            }
            Self::Band(band) => Description {
                name: &bands[band],
                text: "reflectance; NaN = not measured",
                // f32. Many readers ignore no-data values, but all of them know NaN.
                data_type: 9,
                no_data: None,
                scale: None,
            },
        }
    }
}

impl Description<'_> {
    /// The 192 bytes of the specification's table 24.
    fn bytes(self) -> Vec<u8> {
        // Options: bit 0 = no-data value, bit 3 = scale.
        let options = u8::from(self.no_data.is_some()) | u8::from(self.scale.is_some()) << 3;
        let mut bytes = vec![0, 0, self.data_type, options];
        bytes.extend(padded::<32>(self.name));
        bytes.extend([0; 4]);
        bytes.extend(self.no_data.unwrap_or_default());
        // Two unused no-data values, then minima and maxima, which are not given.
        bytes.extend([0; 16 + 24 + 24]);
        bytes.extend(self.scale.unwrap_or(0.0).to_le_bytes());
        // Unused scales, and offsets.
        bytes.extend([0; 16 + 24]);
        bytes.extend(padded::<32>(self.text));
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::columns::COLUMNS;

    #[test]
    fn description_has_the_layout_of_the_specification() {
        let bands = vec!["band_0623nm".to_owned()];
        let extra = ExtraBytes::new(&Present::new(COLUMNS, ["points", "class"]), &bands);
        assert_eq!(extra.fields.len(), 6);
        assert_eq!(extra.n_bytes(), 12);
        let Vlr { data, .. } = extra.vlr();
        assert_eq!(data.len(), 6 * 192);
        let score = &data[192..];
        assert_eq!((score[2], score[3]), (1, 8));
        assert!(score[4..].starts_with(b"score\0"));
        assert!(data[4..].starts_with(b"class_id\0"), "`class` is a keyword of Python");
        let band = &data[5 * 192..];
        assert_eq!((band[2], band[3]), (9, 0));
        assert!(band[4..].starts_with(b"band_0623nm\0"));
        assert_eq!(
            (score[112..120].to_vec(), &band[112..120]),
            ((1.0_f64 / 255.0).to_le_bytes().to_vec(), &[0; 8][..])
        );
        assert!(band[160..].starts_with(b"reflectance; NaN = not measured"));
    }
}
