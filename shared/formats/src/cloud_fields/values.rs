//! Types of values, and numbers as text.

/// Type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// i8.
    I8,
    /// u8.
    U8,
    /// i16.
    I16,
    /// u16.
    U16,
    /// i32.
    I32,
    /// u32.
    U32,
    /// i64.
    I64,
    /// u64.
    U64,
    /// f32.
    F32,
    /// f64.
    F64,
}

impl ValueType {
    /// Name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::I8 => "i8",
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// Bytes of a value.
    pub const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether values can have a fraction.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// The value at the start of these bytes; NaN if there are too few bytes.
    pub fn decode(self, bytes: &[u8], is_big: bool) -> f64 {
        let n = self.size();
        let Some(bytes) = bytes.get(..n) else { return f64::NAN };
        let mut wide = [0; 8];
        wide[..n].copy_from_slice(bytes);
        if is_big {
            wide[..n].reverse();
        }
        let unsigned = u64::from_le_bytes(wide);
        match self {
            Self::I8 => f64::from(unsigned as i8),
            Self::I16 => f64::from(unsigned as i16),
            Self::I32 => f64::from(unsigned as i32),
            Self::I64 => unsigned as i64 as f64,
            Self::F32 => f64::from(f32::from_bits(unsigned as u32)),
            Self::F64 => f64::from_bits(unsigned),
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => unsigned as f64,
        }
    }
}

/// The number of a word. Invalid numbers as the C library of Windows prints them (`-nan(ind)`, `1.#QNAN`, `1.#INF`) are NaN.
pub fn number(word: &str) -> Option<f64> {
    word.parse().ok().or_else(|| is_windows_nan(word).then_some(f64::NAN))
}

/// Whether a word is an invalid number as the C library of Windows prints it.
fn is_windows_nan(word: &str) -> bool {
    let bare = word.trim_start_matches(['-', '+']);
    let is_nan = bare.get(..4).is_some_and(|start| start.eq_ignore_ascii_case("nan(")) && bare.ends_with(')');
    let digits = bare.trim_end_matches('0');
    let is_old = ["1.#IND", "1.#QNAN", "1.#SNAN", "1.#INF", "1.#J", "1.#R"].contains(&digits);
    is_nan || is_old
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_all_c_libraries_are_read() {
        for word in ["nan", "-nan", "NaN", "-nan(ind)", "nan(snan)", "-1.#IND00", "1.#QNAN0", "1.#INF00", "-1.#IND"] {
            assert!(number(word).is_some_and(f64::is_nan), "{word}");
        }
        assert_eq!(number("-1.5e3"), Some(-1500.0));
        assert_eq!(number("inf"), Some(f64::INFINITY));
        for word in ["", "1,5", "nanometers", "1.#", "0x10"] {
            assert_eq!(number(word), None, "{word}");
        }
    }

    #[test]
    fn values_of_both_byte_orders_are_decoded() {
        assert_eq!(ValueType::I16.decode(&[0xfe, 0xff, 7], false), -2.0);
        assert_eq!(ValueType::I16.decode(&[0xff, 0xfe, 7], true), -2.0);
        assert_eq!(ValueType::F64.decode(&0.25_f64.to_be_bytes(), true), 0.25);
        assert_eq!(ValueType::U32.decode(&u32::MAX.to_le_bytes(), false), 4_294_967_295.0);
        assert!(ValueType::U32.decode(&[1, 2, 3], false).is_nan());
    }
}
