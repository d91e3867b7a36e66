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
    fault: Fault,
}

/// What was given, and what the header says.
type Fault = Option<(Kind, Option<Kind>)>;

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
            (self.kinds, self.fault) = watched(self.kinds, self.fault, kind);
        }
        match self.bytes.get_mut(self.at..self.at + N) {
            Some(field) => field.copy_from_slice(&bytes),
            None => self.fault = self.fault.or(Some((kind, None))),
        }
        // Also beyond the end, so that it is known at compile time.
        self.at += N;
        self
    }

    /// Whether every field was given, none too many and each of its kind.
    #[inline]
    pub(super) fn check(&self) -> Result<(), String> {
        if self.fault.is_none() && self.at == self.bytes.len() {
            Ok(())
        } else {
            Err(rule(self.fault, self.bytes.len() - self.at.min(self.bytes.len())))
        }
    }
}

/// What was wrong with a row.
#[cold]
fn rule(fault: Fault, n_missing: usize) -> String {
    match fault {
        Some((got, Some(expected))) => {
            format!("a field was given as {}, its property is {}", got.name(), expected.name())
        }
        Some((got, None)) => format!("a {} was given beyond the last property", got.name()),
        None => format!("fields for the last {n_missing} bytes are missing"),
    }
}

/// The kinds behind the next one, and the first fault. Apart from what happens to every field of every point, and without the row,
/// which then need not be in memory.
#[cold]
fn watched(kinds: &[Kind], fault: Fault, kind: Kind) -> (&[Kind], Fault) {
    match kinds.split_first() {
        Some((next, later)) if *next == kind => (later, fault),
        Some((next, later)) => (later, fault.or(Some((kind, Some(*next))))),
        None => (kinds, fault),
    }
}
