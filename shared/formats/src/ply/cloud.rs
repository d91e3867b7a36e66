//! The vertices of a file as columns of a cloud.

use super::{Kind, PlyError, Vertices};
use crate::cloud_fields::{Column, Field, PointFlags, RawCloud, ValueType};

impl Vertices {
    /// Coordinates, intensities, rings and times, by the names of [`Field`].
    pub fn raw_cloud(&self) -> Result<RawCloud, PlyError> {
        let find = |field: Field| field.find(&self.properties().iter().map(|property| property.name.as_str()));
        let column = |field: Field| -> Result<Option<Column>, PlyError> {
            let Some(index) = find(field) else { return Ok(None) };
            let property = &self.properties()[index];
            let values = self.f64s(&property.name)?;
            Ok(Some(Column { name: property.name.clone(), value_type: property.kind.into(), values }))
        };
        let mut axes = Vec::new();
        for field in [Field::X, Field::Y, Field::Z] {
            // Absent: the error lists the properties of the file.
            let axis = match column(field)? {
                Some(axis) => axis,
                None => {
                    Column { name: String::new(), value_type: ValueType::F32, values: self.f64s(field.names()[0])? }
                }
            };
            axes.push(axis);
        }
        let is_single = axes.iter().any(|axis| axis.value_type == ValueType::F32);
        Ok(RawCloud {
            positions: (0..self.len()).map(|index| [0, 1, 2].map(|axis| axes[axis].values[index])).collect(),
            position_type: if is_single { ValueType::F32 } else { ValueType::F64 },
            intensities: column(Field::Intensity)?,
            beams: column(Field::Ring)?,
            times: column(Field::Time)?,
            viewpoint: self.viewpoint().map(str::to_owned),
            flags: PointFlags::default(),
        })
    }
}

impl From<Kind> for ValueType {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Char => Self::I8,
            Kind::UChar => Self::U8,
            Kind::Short => Self::I16,
            Kind::UShort => Self::U16,
            Kind::Int => Self::I32,
            Kind::UInt => Self::U32,
            Kind::Float => Self::F32,
            Kind::Double => Self::F64,
        }
    }
}
