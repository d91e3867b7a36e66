//! The directory of a TIFF: numbered fields, in the file's byte order.
//!
//! | bytes | of an entry |
//! |---|---|
//! | 0..2 | tag |
//! | 2..4 | type: 1 u8, 3 u16, 4 u32, 5 two u32 |
//! | 4..8 | number of values |
//! | 8..12 | the values if they fit, else where they are |

use super::TiffError;

/// A field with more values is none of an image's: 32768 rows of 256 planes have as many strips.
const MAX_VALUES: usize = 32_768 * 256;

/// A file's bytes with their order.
pub struct Fields<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

impl Fields<'_> {
    pub fn u16_of(&self, pair: [u8; 2]) -> u16 {
        if self.is_big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
    }
    fn u16_at(&self, at: usize) -> Result<u16, TiffError> {
        let pair = self.bytes.get(at..).and_then(|rest| rest.first_chunk());
        pair.map(|pair| self.u16_of(*pair)).ok_or_else(|| self.ends(at))
    }
    fn u32_at(&self, at: usize) -> Result<u32, TiffError> {
        let word = self.bytes.get(at..).and_then(|rest| rest.first_chunk()).ok_or_else(|| self.ends(at))?;
        Ok(if self.is_big_endian { u32::from_be_bytes(*word) } else { u32::from_le_bytes(*word) })
    }
    fn ends(&self, at: usize) -> TiffError {
        TiffError { offset: at, rule: format!("must lie in the file's {} bytes", self.bytes.len()) }
    }
}

struct Entry {
    tag: u16,
    kind: u16,
    count: usize,
    /// Of the entry.
    at: usize,
}

/// The entries.
pub struct Directory {
    entries: Vec<Entry>,
    at: usize,
}

impl Directory {
    /// The directory of a file's first image.
    pub fn first(bytes: &[u8]) -> Result<(Fields<'_>, Self), TiffError> {
        let is_big_endian = match bytes.get(..4) {
            Some(b"II*\0") => false,
            Some(b"MM\0*") => true,
            _ => return Err(TiffError { offset: 0, rule: "must begin with II*\\0 or MM\\0* (TIFF)".into() }),
        };
        let fields = Fields { bytes, is_big_endian };
        let at = fields.u32_at(4)? as usize;
        let directory = Self::at(&fields, at)?;
        Ok((fields, directory))
    }

    /// The directory at a place of the file.
    pub fn at(fields: &Fields<'_>, at: usize) -> Result<Self, TiffError> {
        let n = usize::from(fields.u16_at(at)?);
        let entry = |i: usize| {
            let at = at + 2 + 12 * i;
            let count = fields.u32_at(at + 4)? as usize;
            fields.u32_at(at + 8)?;
            Ok(Entry { tag: fields.u16_at(at)?, kind: fields.u16_at(at + 2)?, count, at })
        };
        Ok(Self { entries: (0..n).map(entry).collect::<Result<_, _>>()?, at })
    }

    pub fn has(&self, tag: u16) -> bool {
        self.entries.iter().any(|entry| entry.tag == tag)
    }

    /// Where the field stands, for errors; that of the directory if it has none.
    pub fn offset(&self, tag: u16) -> usize {
        self.entries.iter().find(|entry| entry.tag == tag).map_or(self.at, |entry| entry.at)
    }

    /// The whole numbers of a field; none if there is no such field.
    pub fn numbers(&self, fields: &Fields<'_>, tag: u16) -> Result<Vec<u32>, TiffError> {
        let Some(entry) = self.entries.iter().find(|entry| entry.tag == tag) else { return Ok(Vec::new()) };
        let size = match entry.kind {
            1 => 1,
            3 => 2,
            4 => 4,
            kind => {
                let rule = format!("tag {tag} is of type {kind}; must be 1, 3 or 4: a whole number");
                return Err(TiffError { offset: entry.at, rule });
            }
        };
        if entry.count > MAX_VALUES {
            let rule = format!("tag {tag} has {} values; must have {MAX_VALUES} at most", entry.count);
            return Err(TiffError { offset: entry.at, rule });
        }
        let at = if size * entry.count <= 4 { entry.at + 8 } else { fields.u32_at(entry.at + 8)? as usize };
        // So that a promise of millions of values is not believed before they are there.
        let inside = at.checked_add(size * entry.count).is_some_and(|end| end <= fields.bytes.len());
        if !inside {
            return Err(fields.ends(at));
        }
        let value = |i: usize| match size {
            1 => Ok(u32::from(fields.bytes[at + i])),
            2 => fields.u16_at(at + 2 * i).map(u32::from),
            _ => fields.u32_at(at + 4 * i),
        };
        (0..entry.count).map(value).collect()
    }

    /// A field that is a fraction.
    pub fn rational(&self, fields: &Fields<'_>, tag: u16) -> Option<[u32; 2]> {
        let entry = self.entries.iter().find(|entry| entry.tag == tag && entry.kind == 5)?;
        let at = fields.u32_at(entry.at + 8).ok()? as usize;
        Some([fields.u32_at(at).ok()?, fields.u32_at(at.checked_add(4)?).ok()?])
    }
}
