//! One packed row, field by field.

use super::Kind;

/// Takes the fields of one point in the order of the header's properties.
#[derive(Debug)]
pub struct Row<'a> {
    rest: &'a mut [u8],
    /// What comes next; empty if the kinds are not watched.
    kinds: &'a [Kind],
    fault: Option<(Kind, Option<Kind>)>,
}

impl<'a> Row<'a> {
    /// `kinds` are watched if there are any; the number of bytes always is.
    pub(super) fn new(bytes: &'a mut [u8], kinds: &'a [Kind]) -> Self {
        Self { rest: bytes, kinds, fault: None }
    }

    /// The next field, a `float`.
    #[inline]
    pub fn f32(&mut self, value: f32) -> &mut Self {
        self.put(Kind::Float, value.to_le_bytes())
    }
    /// The next field, a `double`.
    #[inline]
    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.put(Kind::Double, value.to_le_bytes())
    }
    /// The next field, a `uchar`.
    #[inline]
    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.put(Kind::UChar, [value])
    }
    /// The next field, an `int`.
    #[inline]
    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.put(Kind::Int, value.to_le_bytes())
    }

    #[inline]
    fn put<const N: usize>(&mut self, kind: Kind, bytes: [u8; N]) -> &mut Self {
        if let Some((next, later)) = self.kinds.split_first() {
            if *next != kind {
                self.fault.get_or_insert((kind, Some(*next)));
            }
            self.kinds = later;
        }
        match std::mem::take(&mut self.rest).split_first_chunk_mut::<N>() {
            Some((field, rest)) => {
                *field = bytes;
                self.rest = rest;
            }
            None => {
                self.fault.get_or_insert((kind, None));
            }
        }
        self
    }

    /// Whether every field was given, none too many and each of its kind.
    pub(super) fn check(&self) -> Result<(), String> {
        match self.fault {
            Some((got, Some(expected))) => {
                Err(format!("a field was given as {}, its property is {}", got.name(), expected.name()))
            }
            Some((got, None)) => Err(format!("a {} was given beyond the last property", got.name())),
            None if !self.rest.is_empty() => Err(format!("fields for the last {} bytes are missing", self.rest.len())),
            None => Ok(()),
        }
    }
}
