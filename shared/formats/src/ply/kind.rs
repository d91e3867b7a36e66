//! Types of scalar properties.

use ply_rs::ply::ScalarType;

/// Type of a scalar property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// i8, read only.
    Char,
    /// u8.
    UChar,
    /// i16, read only.
    Short,
    /// u16, read only.
    UShort,
    /// i32.
    Int,
    /// u32, read only.
    UInt,
    /// f32.
    Float,
    /// f64.
    Double,
}

impl Kind {
    /// Name in the header.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Char => "char",
            Kind::UChar => "uchar",
            Kind::Short => "short",
            Kind::UShort => "ushort",
            Kind::Int => "int",
            Kind::UInt => "uint",
            Kind::Float => "float",
            Kind::Double => "double",
        }
    }
    /// Bytes of a value.
    pub const fn size(self) -> usize {
        match self {
            Kind::Char | Kind::UChar => 1,
            Kind::Short | Kind::UShort => 2,
            Kind::Int | Kind::UInt | Kind::Float => 4,
            Kind::Double => 8,
        }
    }
    /// The value at the start of little-endian bytes; NaN if there are too few bytes.
    pub fn value(self, bytes: &[u8]) -> f64 {
        let found = match self {
            Kind::Char => bytes.first_chunk().map(|b| f64::from(i8::from_le_bytes(*b))),
            Kind::UChar => bytes.first_chunk().map(|b| f64::from(u8::from_le_bytes(*b))),
            Kind::Short => bytes.first_chunk().map(|b| f64::from(i16::from_le_bytes(*b))),
            Kind::UShort => bytes.first_chunk().map(|b| f64::from(u16::from_le_bytes(*b))),
            Kind::Int => bytes.first_chunk().map(|b| f64::from(i32::from_le_bytes(*b))),
            Kind::UInt => bytes.first_chunk().map(|b| f64::from(u32::from_le_bytes(*b))),
            Kind::Float => bytes.first_chunk().map(|b| f64::from(f32::from_le_bytes(*b))),
            Kind::Double => bytes.first_chunk().map(|b| f64::from_le_bytes(*b)),
        };
        found.unwrap_or(f64::NAN)
    }
    /// Whether common readers support the type: `Open3D` skips the others.
    pub(super) const fn is_widely_supported(self) -> bool {
        matches!(self, Kind::UChar | Kind::Int | Kind::Float | Kind::Double)
    }
}

impl From<&ScalarType> for Kind {
    fn from(scalar: &ScalarType) -> Self {
        match scalar {
            ScalarType::Char => Kind::Char,
            ScalarType::UChar => Kind::UChar,
            ScalarType::Short => Kind::Short,
            ScalarType::UShort => Kind::UShort,
            ScalarType::Int => Kind::Int,
            ScalarType::UInt => Kind::UInt,
            ScalarType::Float => Kind::Float,
            ScalarType::Double => Kind::Double,
        }
    }
}

impl From<Kind> for ScalarType {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Char => ScalarType::Char,
            Kind::UChar => ScalarType::UChar,
            Kind::Short => ScalarType::Short,
            Kind::UShort => ScalarType::UShort,
            Kind::Int => ScalarType::Int,
            Kind::UInt => ScalarType::UInt,
            Kind::Float => ScalarType::Float,
            Kind::Double => ScalarType::Double,
        }
    }
}
