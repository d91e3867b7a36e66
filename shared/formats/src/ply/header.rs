//! The part that people can read.

use super::PlyError;
use std::fmt::Write;
use std::path::Path;

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
    /// As the header writes it.
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
    /// Whether the popular readers understand it.
    const fn may_be_written(self) -> bool {
        matches!(self, Kind::UChar | Kind::Int | Kind::Float | Kind::Double)
    }
}

/// One column of the cloud.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    /// Letters, digits and underscores, not a digit first.
    pub name: String,
    /// Its type.
    pub kind: Kind,
}

impl Property {
    /// A column.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self { name: name.into(), kind }
    }
}

/// What a cloud says about itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Lines `comment …`, for people.
    pub comments: Vec<String>,
    /// Lines `obj_info …`, for programs: `frame`, `epoch`, `crs`.
    pub infos: Vec<String>,
    /// Columns in the order of the row.
    pub properties: Vec<Property>,
}

/// Readers that search the header for these words find them in comments too.
const GRAMMAR_WORDS: [&str; 3] = ["element", "property", "end_header"];

impl Header {
    /// A header with these columns and without comments.
    pub fn new<'a>(properties: impl IntoIterator<Item = (&'a str, Kind)>) -> Self {
        let properties = properties.into_iter().map(|(name, kind)| Property::new(name, kind)).collect();
        Self { properties, ..Self::default() }
    }
    /// With one more `comment` line.
    #[must_use]
    pub fn comment(mut self, text: impl Into<String>) -> Self {
        self.comments.push(text.into());
        self
    }
    /// With one more `obj_info` line.
    #[must_use]
    pub fn info(mut self, text: impl Into<String>) -> Self {
        self.infos.push(text.into());
        self
    }
    /// Bytes of a row.
    pub fn row_size(&self) -> usize {
        self.properties.iter().map(|property| property.kind.size()).sum()
    }

    /// The text up to the first row, or which line breaks which rule.
    pub(super) fn encode(&self, n_points: usize, path: &Path) -> Result<String, PlyError> {
        // Writing to a string cannot fail.
        let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
        let fault = |text: &str, rule| Err(PlyError::header(path, text.lines().count() + 1, rule));
        for (keyword, lines) in [("comment", &self.comments), ("obj_info", &self.infos)] {
            for line in lines {
                if let Err(rule) = check_text(line) {
                    return fault(&text, rule);
                }
                let _ = writeln!(text, "{keyword} {line}");
            }
        }
        let _ = writeln!(text, "element vertex {n_points}");
        for (index, property) in self.properties.iter().enumerate() {
            if let Err(rule) = check_property(property, &self.properties[..index]) {
                return fault(&text, rule);
            }
            let _ = writeln!(text, "property {} {}", property.kind.name(), property.name);
        }
        text.push_str("end_header\n");
        Ok(text)
    }
}

fn check_text(line: &str) -> Result<(), String> {
    if !line.bytes().all(|byte| (b' '..=b'~').contains(&byte)) {
        return Err(format!("text {line:?} must be printable ASCII on one line"));
    }
    match GRAMMAR_WORDS.iter().find(|word| line.contains(*word)) {
        Some(word) => Err(format!("text {line:?} must not contain {word:?}, which readers take for the header's own")),
        None => Ok(()),
    }
}

fn check_property(property: &Property, earlier: &[Property]) -> Result<(), String> {
    let name = &property.name;
    let word = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    if !word || name.bytes().next().is_none_or(|byte| byte.is_ascii_digit()) {
        return Err(format!("name {name:?} must be letters, digits and underscores, not a digit first"));
    }
    if earlier.iter().any(|other| other.name == *name) {
        return Err(format!("name {name:?} stands twice"));
    }
    if !property.kind.may_be_written() {
        return Err(format!(
            "{name} is {}, must be float, double, uchar or int: readers skip others",
            property.kind.name()
        ));
    }
    Ok(())
}
