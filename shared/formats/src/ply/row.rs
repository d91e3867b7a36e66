//! One packed row, field by field.

use super::Kind;

/// Takes the fields of one point in the order of the header's properties.
#[derive(Debug)]
pub struct Row<'a> {
    bytes: &'a mut [u8],
    /// Where the next field begins.
    at: usize,
    /// What comes next; empty if the kinds are not watched.
    kinds: &'a [Kind],
    fault: Option<(Kind, Option<Kind>)>,
}

impl<'a> Row<'a> {
    /// `kinds` are watched if there are any; the number of bytes always is.
    pub(super) fn new(bytes: &'a mut [u8], kinds: &'a [Kind]) -> Self {
        Self { bytes, at: 0, kinds, fault: None }
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
        if !self.kinds.is_empty() {
            self.watch(kind);
        }
        match self.bytes.get_mut(self.at..self.at + N) {
            Some(field) => {
                field.copy_from_slice(&bytes);
                self.at += N;
            }
            None => self.fault = self.fault.or(Some((kind, None))),
        }
        self
    }

    // Apart from what happens to every field of every point.
    #[cold]
    fn watch(&mut self, kind: Kind) {
        if let Some((next, later)) = self.kinds.split_first() {
            if *next != kind {
                self.fault.get_or_insert((kind, Some(*next)));
            }
            self.kinds = later;
        }
    }

    /// Whether every field was given, none too many and each of its kind.
    pub(super) fn check(&self) -> Result<(), String> {
        match self.fault {
            Some((got, Some(expected))) => {
                Err(format!("a field was given as {}, its property is {}", got.name(), expected.name()))
            }
            Some((got, None)) => Err(format!("a {} was given beyond the last property", got.name())),
            None => match self.bytes.len() - self.at {
                0 => Ok(()),
                n => Err(format!("fields for the last {n} bytes are missing")),
            },
        }
    }
}
