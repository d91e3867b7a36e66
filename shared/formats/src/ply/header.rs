//! The text header.

use super::error::UnwritableHeader;
use super::{Kind, PlyError};
use ply_rs::ply::{Addable, DefaultElement, ElementDef, Encoding, PropertyDef, PropertyType};
use ply_rs::writer::Writer;
use std::path::Path;

/// One column of the cloud.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    /// Letters, digits and underscores, not starting with a digit.
    pub name: String,
    /// Type of the values.
    pub kind: Kind,
}

impl Property {
    /// A column.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self { name: name.into(), kind }
    }
}

/// Metadata and columns of a cloud.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Lines `comment …`, not read by programs.
    pub comments: Vec<String>,
    /// Lines `obj_info …`, read by programs: `frame`, `epoch`, `crs`.
    pub infos: Vec<String>,
    /// Columns in the order of the row.
    pub properties: Vec<Property>,
}

/// Keywords that may not occur in comments, because readers search the header for them.
const KEYWORDS: [&str; 3] = ["element", "property", "end_header"];

impl Header {
    /// A header with these columns and without comments.
    pub fn new<'a>(properties: impl IntoIterator<Item = (&'a str, Kind)>) -> Self {
        let properties = properties.into_iter().map(|(name, kind)| Property::new(name, kind)).collect();
        Self { properties, ..Self::default() }
    }
    /// Adds a `comment` line.
    #[must_use]
    pub fn comment(mut self, text: impl Into<String>) -> Self {
        self.comments.push(text.into());
        self
    }
    /// Adds an `obj_info` line.
    #[must_use]
    pub fn info(mut self, text: impl Into<String>) -> Self {
        self.infos.push(text.into());
        self
    }
    /// Bytes of a row.
    pub fn row_size(&self) -> usize {
        self.properties.iter().map(|property| property.kind.size()).sum()
    }

    /// The bytes before the first row, written by ply-rs.
    pub(super) fn encode(&self, n_points: usize, path: &Path) -> Result<Vec<u8>, PlyError> {
        self.check().map_err(|(line, reason)| PlyError::UnwritableHeader { path: path.to_owned(), line, reason })?;
        let mut vertex = ElementDef::new("vertex".to_owned());
        vertex.count = n_points;
        for Property { name, kind } in &self.properties {
            vertex.properties.add(PropertyDef::new(name.clone(), PropertyType::Scalar((*kind).into())));
        }
        let mut header = ply_rs::ply::Header::new();
        header.encoding = Encoding::BinaryLittleEndian;
        header.comments.clone_from(&self.comments);
        header.obj_infos.clone_from(&self.infos);
        header.elements.add(vertex);
        let mut bytes = Vec::new();
        Writer::<DefaultElement>::new().write_header(&mut bytes, &header).map_err(PlyError::io(path, "write"))?;
        Ok(bytes)
    }

    /// Checks that common readers can read the header. The error is a line, from 1, and its fault.
    fn check(&self) -> Result<(), (usize, UnwritableHeader)> {
        // Line 1 is the magic number, line 2 the format.
        for (line, text) in (3..).zip(self.comments.iter().chain(&self.infos)) {
            check_text(text).map_err(|reason| (line, reason))?;
        }
        let first_line = 4 + self.comments.len() + self.infos.len();
        for (idx, property) in self.properties.iter().enumerate() {
            check_property(property, &self.properties[..idx]).map_err(|reason| (first_line + idx, reason))?;
        }
        Ok(())
    }
}

fn check_text(text: &str) -> Result<(), UnwritableHeader> {
    if !text.bytes().all(|byte| (b' '..=b'~').contains(&byte)) {
        return Err(UnwritableHeader::Text(text.to_owned()));
    }
    match KEYWORDS.into_iter().find(|keyword| text.contains(keyword)) {
        Some(keyword) => Err(UnwritableHeader::Keyword { text: text.to_owned(), keyword }),
        None => Ok(()),
    }
}

fn check_property(property: &Property, earlier: &[Property]) -> Result<(), UnwritableHeader> {
    let Property { name, kind } = property;
    let is_word = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    if !is_word || name.bytes().next().is_none_or(|byte| byte.is_ascii_digit()) {
        return Err(UnwritableHeader::Name(name.clone()));
    }
    if earlier.iter().any(|other| other.name == *name) {
        return Err(UnwritableHeader::DuplicateName(name.clone()));
    }
    if !kind.is_widely_supported() {
        return Err(UnwritableHeader::Kind { name: name.clone(), kind: kind.name() });
    }
    Ok(())
}
