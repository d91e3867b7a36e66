//! Reading whole clouds.

use super::{Header, HeaderFault, Kind, PayloadFault, PlyError, Property, PropertyFault, camera, packed};
use files::regular_file;
use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{DefaultElement, ElementDef, Encoding, PropertyType};
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Longest header that is read. Headers written here are shorter than 2 KiB.
pub(super) const MAX_HEADER: usize = 1 << 20;

/// The points of a PLY file, kept as packed little-endian rows.
#[derive(Clone, Debug)]
pub struct Vertices {
    path: PathBuf,
    comments: Vec<String>,
    infos: Vec<String>,
    viewpoint: Option<String>,
    properties: Vec<Property>,
    n_points: usize,
    row_size: usize,
    bytes: Vec<u8>,
    rows: Range<usize>,
}

impl Vertices {
    /// Reads the whole file.
    pub fn load(path: &Path) -> Result<Self, PlyError> {
        Self::decode(regular_file::read(path).map_err(PlyError::io(path, "read"))?, path)
    }

    /// Decodes the content of a file. `path` is used in errors only. Lists and elements other than `vertex` are skipped.
    pub fn decode(bytes: Vec<u8>, path: &Path) -> Result<Self, PlyError> {
        let start = header_len(&bytes, path)?;
        let head = parse_header(&bytes[..start], path)?;
        let vertex = head.elements.get("vertex").ok_or_else(|| PlyError::header(path, 1, HeaderFault::NoVertex))?;
        let properties = scalar_properties(vertex);
        let row_size: usize = properties.iter().map(|property| property.kind.size()).sum();
        if row_size == 0 && vertex.count > 0 {
            return Err(PlyError::header(path, 1, HeaderFault::NoScalar { n_points: vertex.count }));
        }
        let mut vertices = Self {
            path: path.to_owned(),
            comments: head.comments.clone(),
            infos: head.obj_infos.clone(),
            viewpoint: None,
            n_points: vertex.count,
            properties,
            row_size,
            bytes: Vec::new(),
            rows: 0..0,
        };
        if head.encoding == Encoding::BinaryLittleEndian && is_plain(&head, vertex) {
            vertices.rows = plain_rows(&head, "vertex", start, bytes.len(), path)?;
            vertices.viewpoint = camera::viewpoint(&head, &bytes, start, path);
            vertices.bytes = bytes;
        } else {
            vertices.bytes = packed::packed_rows(&head, "vertex", &bytes, start, path)?;
            vertices.viewpoint = camera::viewpoint(&head, &bytes, start, path);
            vertices.rows = 0..vertices.bytes.len();
        }
        Ok(vertices)
    }

    /// Packed rows of a file with this header.
    pub(super) fn from_rows(path: &Path, header: &Header, bytes: Vec<u8>) -> Self {
        let row_size = header.row_size();
        Self {
            path: path.to_owned(),
            comments: header.comments.clone(),
            infos: header.infos.clone(),
            viewpoint: None,
            properties: header.properties.clone(),
            n_points: bytes.len() / row_size.max(1),
            row_size,
            rows: 0..bytes.len(),
            bytes,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.n_points
    }
    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.n_points == 0
    }
    /// The columns.
    pub fn properties(&self) -> &[Property] {
        &self.properties
    }
    /// Lines `comment …`.
    pub fn comments(&self) -> &[String] {
        &self.comments
    }
    /// Lines `obj_info …`.
    pub fn infos(&self) -> &[String] {
        &self.infos
    }
    /// Pose of the sensor in the element `camera`, in its words; `None` if it is absent or the identity.
    pub fn viewpoint(&self) -> Option<&str> {
        self.viewpoint.as_deref()
    }
    /// Whether a column of this name exists.
    pub fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|property| property.name == name)
    }
    /// Packed rows, little-endian, in the order of [`Vertices::properties`].
    pub fn rows(&self) -> &[u8] {
        &self.bytes[self.rows.clone()]
    }

    /// A column of any type as f64, without loss.
    pub fn f64s(&self, name: &str) -> Result<Vec<f64>, PlyError> {
        let (kind, at) = self.column(name)?;
        Ok(match kind {
            Kind::Char => self.gather(at, |b| f64::from(i8::from_le_bytes(b))),
            Kind::UChar => self.gather(at, |b| f64::from(u8::from_le_bytes(b))),
            Kind::Short => self.gather(at, |b| f64::from(i16::from_le_bytes(b))),
            Kind::UShort => self.gather(at, |b| f64::from(u16::from_le_bytes(b))),
            Kind::Int => self.gather(at, |b| f64::from(i32::from_le_bytes(b))),
            Kind::UInt => self.gather(at, |b| f64::from(u32::from_le_bytes(b))),
            Kind::Float => self.gather(at, |b| f64::from(f32::from_le_bytes(b))),
            Kind::Double => self.gather(at, f64::from_le_bytes),
        })
    }

    /// A column of any type as f32. `double`, `int` and `uint` are rounded.
    pub fn f32s(&self, name: &str) -> Result<Vec<f32>, PlyError> {
        match self.column(name)? {
            (Kind::Float, at) => Ok(self.gather(at, f32::from_le_bytes)),
            _ => Ok(self.f64s(name)?.into_iter().map(|value| value as f32).collect()),
        }
    }

    /// A column of integers. Floating-point values must be integers up to 2^53.
    pub fn i64s(&self, name: &str) -> Result<Vec<i64>, PlyError> {
        let values = self.f64s(name)?;
        // 2^53: every integer up to this value is an f64.
        match values.iter().position(|value| value.fract() != 0.0 || value.abs() > 9_007_199_254_740_992.0) {
            Some(point) => Err(self.property_error(name, PropertyFault::NotInteger { point, value: values[point] })),
            None => Ok(values.into_iter().map(|value| value as i64).collect()),
        }
    }

    /// A column of integers from 0 to 255, of any type.
    pub fn u8s(&self, name: &str) -> Result<Vec<u8>, PlyError> {
        if let (Kind::UChar, at) = self.column(name)? {
            return Ok(self.gather(at, u8::from_le_bytes));
        }
        let small =
            |value: i64| u8::try_from(value).map_err(|_| self.property_error(name, PropertyFault::NotByte(value)));
        self.i64s(name)?.into_iter().map(small).collect()
    }

    fn column(&self, name: &str) -> Result<(Kind, usize), PlyError> {
        let mut at = 0;
        for property in &self.properties {
            if property.name == name {
                return Ok((property.kind, at));
            }
            at += property.kind.size();
        }
        let known = self.properties.iter().map(|property| property.name.clone()).collect();
        Err(self.property_error(name, PropertyFault::Missing { known }))
    }

    fn gather<const N: usize, T>(&self, at: usize, value: impl Fn([u8; N]) -> T) -> Vec<T> {
        let field = |row: &[u8]| row[at..].first_chunk::<N>().map(|bytes| value(*bytes));
        self.rows().chunks_exact(self.row_size.max(1)).filter_map(field).collect()
    }

    fn property_error(&self, name: &str, fault: PropertyFault) -> PlyError {
        PlyError::Property { path: self.path.clone(), name: name.to_owned(), fault }
    }
}

/// Offset of the first row.
pub(super) fn header_len(bytes: &[u8], path: &Path) -> Result<usize, PlyError> {
    if !bytes.starts_with(b"ply") {
        return Err(PlyError::header(path, 1, HeaderFault::NoMagic));
    }
    let mut start = 0;
    if bytes.starts_with(b"ply\r") && bytes.get(4) != Some(&b'\n') {
        return Err(PlyError::header(path, 1, HeaderFault::CarriageReturns));
    }
    for (index, line) in bytes[..bytes.len().min(MAX_HEADER)].split_inclusive(|byte| *byte == b'\n').enumerate() {
        start += line.len();
        if line.trim_ascii_end() == b"end_header" {
            return Ok(start);
        }
        if !line.ends_with(b"\n") {
            return Err(PlyError::header(path, index + 1, HeaderFault::NoEnd));
        }
    }
    Err(PlyError::header(path, 1, HeaderFault::NoEnd))
}

pub(super) fn parse_header(bytes: &[u8], path: &Path) -> Result<ply_rs::ply::Header, PlyError> {
    let text = utf8_header(bytes);
    let bytes = &*text;
    let head = Parser::<DefaultElement>::new()
        .read_header(&mut Reader::new(bytes))
        .map_err(|error| PlyError::header(path, error.line().unwrap_or(1), HeaderFault::Parser(error.to_string())))?;
    // Of two properties with the same name the parser keeps the last, which would shift all later fields.
    let lines = bytes.split(|byte| *byte == b'\n').filter(|line| line.starts_with(b"property")).count();
    let kept: usize = head.elements.values().map(|element| element.properties.len()).sum();
    let elements = bytes.split(|byte| *byte == b'\n').filter(|line| line.starts_with(b"element")).count();
    if lines != kept || elements != head.elements.len() {
        return Err(PlyError::header(path, 1, HeaderFault::DuplicateName));
    }
    Ok(head)
}

/// The header with comments in Latin-1 as UTF-8.
fn utf8_header(bytes: &[u8]) -> Cow<'_, [u8]> {
    if std::str::from_utf8(bytes).is_ok() {
        return Cow::Borrowed(bytes);
    }
    let mut text = Vec::new();
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let is_text = [&b"comment"[..], b"obj_info"].iter().any(|keyword| line.starts_with(keyword));
        if is_text && std::str::from_utf8(line).is_err() {
            // Each byte of Latin-1 is the code of its letter.
            text.extend(line.iter().map(|byte| char::from(*byte)).collect::<String>().into_bytes());
        } else {
            text.extend_from_slice(line);
        }
    }
    Cow::Owned(text)
}

/// The scalar columns of an element.
pub(super) fn scalar_properties(element: &ElementDef) -> Vec<Property> {
    let scalars = element.properties.values().filter_map(|property| match &property.data_type {
        PropertyType::Scalar(scalar) => Some(Property::new(property.name.clone(), scalar.into())),
        PropertyType::List(..) => None,
    });
    scalars.collect()
}

/// Whether all rows up to the end of the vertices have a fixed size.
pub(super) fn is_plain(head: &ply_rs::ply::Header, vertex: &ElementDef) -> bool {
    let up_to_vertex = head.elements.values().take_while(|element| element.name != vertex.name);
    up_to_vertex.chain([vertex]).all(|element| scalar_properties(element).len() == element.properties.len())
}

/// Byte range of the rows of an element in a plain file.
pub(super) fn plain_rows(
    head: &ply_rs::ply::Header,
    name: &str,
    start: usize,
    len: usize,
    path: &Path,
) -> Result<Range<usize>, PlyError> {
    let mut start = start;
    for element in head.elements.values() {
        let row_size: usize = scalar_properties(element).iter().map(|property| property.kind.size()).sum();
        let end = element.count.checked_mul(row_size).and_then(|size| size.checked_add(start));
        let Some(end) = end.filter(|end| *end <= len) else {
            let fault = PayloadFault::Cut { n_rows: element.count, element: element.name.clone(), row_size };
            return Err(PlyError::payload(path, len, fault));
        };
        if element.name == name {
            return Ok(start..end);
        }
        start = end;
    }
    Err(PlyError::header(path, 1, HeaderFault::NoVertex))
}
