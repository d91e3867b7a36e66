//! Encoding of one row, field by field.

use super::Kind;
use super::error::RowMismatch;

/// Takes the fields of one point in the order of the properties in the header.
#[derive(Debug)]
pub struct Row<'a> {
    bytes: &'a mut [u8],
    /// Offset of the next field.
    at: usize,
    /// Expected kinds of the remaining fields; empty if kinds are not checked.
    kinds: &'a [Kind],
    mismatch: Option<RowMismatch>,
}

impl<'a> Row<'a> {
    /// Checks the kinds of fields only if `kinds` is not empty. The number of bytes is always checked.
    pub(super) fn new(bytes: &'a mut [u8], kinds: &'a [Kind]) -> Self {
        Self { bytes, at: 0, kinds, mismatch: None }
    }

    /// Appends a `float` field.
    #[inline]
    pub fn f32(&mut self, value: f32) -> &mut Self {
        self.put(Kind::Float, value.to_le_bytes())
    }
    /// Appends a `double` field.
    #[inline]
    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.put(Kind::Double, value.to_le_bytes())
    }
    /// Appends a `uchar` field.
    #[inline]
    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.put(Kind::UChar, [value])
    }
    /// Appends an `int` field.
    #[inline]
    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.put(Kind::Int, value.to_le_bytes())
    }

    #[inline]
    fn put<const N: usize>(&mut self, kind: Kind, bytes: [u8; N]) -> &mut Self {
        if !self.kinds.is_empty() {
            (self.kinds, self.mismatch) = check_kind(self.kinds, self.mismatch, kind);
        }
        match self.bytes.get_mut(self.at..self.at + N) {
            Some(field) => field.copy_from_slice(&bytes),
            None => self.mismatch = self.mismatch.or(Some(RowMismatch::ExtraField { found: kind.name() })),
        }
        // Advances also beyond the end, so that the offset is known at compile time.
        self.at += N;
        self
    }

    /// Whether exactly the fields of the header were given.
    #[inline]
    pub(super) fn check(&self) -> Result<(), RowMismatch> {
        if self.mismatch.is_none() && self.at == self.bytes.len() {
            Ok(())
        } else {
            let n_bytes = self.bytes.len() - self.at.min(self.bytes.len());
            Err(self.mismatch.unwrap_or(RowMismatch::MissingFields { n_bytes }))
        }
    }
}

/// Kinds after the next one, and the first mismatch. A separate function without access to the row, so that the row can
/// stay in registers in the loop over all points.
#[cold]
fn check_kind(kinds: &[Kind], mismatch: Option<RowMismatch>, kind: Kind) -> (&[Kind], Option<RowMismatch>) {
    match kinds.split_first() {
        Some((next, later)) if *next == kind => (later, mismatch),
        Some((next, later)) => {
            let here = RowMismatch::Kind { found: kind.name(), expected: next.name() };
            (later, mismatch.or(Some(here)))
        }
        None => (kinds, mismatch),
    }
}
