//! Values of serialized messages.
//!
//! | | ROS 1 | CDR (ROS 2) |
//! |---|---|---|
//! | byte order | little | given by the first bytes of the message |
//! | alignment | none | each number at a multiple of its size |
//! | text | length, bytes | length with a final zero, bytes, zero |

use super::bag::Encoding;

/// Error of a message that cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum MessageFault {
    #[error(
        "{field} ends past the end of the message, which has {n_bytes} bytes: it is cut, or its type has another layout"
    )]
    End { field: &'static str, n_bytes: usize },
    #[error("CDR encapsulation {0:#06x}; must be 0, 1, 6 or 7 (CDR)")]
    Encapsulation(u16),
    #[error("{0}")]
    Rule(String),
}

/// Reads a message from its start.
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big: bool,
    /// Largest alignment; 1 for ROS 1.
    max_align: usize,
    is_cdr: bool,
    /// Bytes before the first value.
    head: usize,
}

impl<'a> Cursor<'a> {
    pub fn new(encoding: Encoding, message: &'a [u8]) -> Result<Self, MessageFault> {
        let cursor = |is_cdr, is_big, max_align, bytes| Self { bytes, at: 0, is_big, max_align, is_cdr, head: 0 };
        if encoding == Encoding::Ros1 {
            return Ok(cursor(false, false, 1, message));
        }
        let Some(([kind_high, kind_low, _, _], bytes)) = message.split_first_chunk() else {
            return Err(MessageFault::End { field: "the encapsulation", n_bytes: message.len() });
        };
        let kind = u16::from_be_bytes([*kind_high, *kind_low]);
        let max_align = match kind {
            0 | 1 => 8,
            6 | 7 => 4,
            _ => return Err(MessageFault::Encapsulation(kind)),
        };
        Ok(Self { head: 4, ..cursor(true, kind % 2 == 0, max_align, bytes) })
    }

    pub fn is_ros1(&self) -> bool {
        !self.is_cdr
    }

    fn end(&self, field: &'static str) -> MessageFault {
        MessageFault::End { field, n_bytes: self.bytes.len() + self.head }
    }

    pub fn bytes(&mut self, field: &'static str, n: usize) -> Result<&'a [u8], MessageFault> {
        let end = self.at.checked_add(n);
        let found = end.and_then(|end| self.bytes.get(self.at..end)).ok_or_else(|| self.end(field))?;
        self.at += n;
        Ok(found)
    }

    fn number<const N: usize>(&mut self, field: &'static str) -> Result<[u8; N], MessageFault> {
        self.at = self.at.next_multiple_of(N.min(self.max_align));
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.bytes(field, N)?);
        if self.is_big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub fn u8(&mut self, field: &'static str) -> Result<u8, MessageFault> {
        self.number(field).map(u8::from_le_bytes)
    }

    pub fn u16(&mut self, field: &'static str) -> Result<u16, MessageFault> {
        self.number(field).map(u16::from_le_bytes)
    }

    pub fn u32(&mut self, field: &'static str) -> Result<u32, MessageFault> {
        self.number(field).map(u32::from_le_bytes)
    }

    pub fn u64(&mut self, field: &'static str) -> Result<u64, MessageFault> {
        self.number(field).map(u64::from_le_bytes)
    }

    pub fn f32(&mut self, field: &'static str) -> Result<f32, MessageFault> {
        self.number(field).map(f32::from_le_bytes)
    }

    pub fn f64(&mut self, field: &'static str) -> Result<f64, MessageFault> {
        self.number(field).map(f64::from_le_bytes)
    }

    pub fn f64s<const N: usize>(&mut self, field: &'static str) -> Result<[f64; N], MessageFault> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64(field)?;
        }
        Ok(values)
    }

    /// Length of a sequence whose elements have at least `element_bytes`.
    pub fn length(&mut self, field: &'static str, element_bytes: usize) -> Result<usize, MessageFault> {
        let n = self.u32(field)? as usize;
        let left = self.bytes.len().saturating_sub(self.at);
        if n.saturating_mul(element_bytes) > left { Err(self.end(field)) } else { Ok(n) }
    }

    /// A sequence of bytes.
    pub fn blob(&mut self, field: &'static str) -> Result<&'a [u8], MessageFault> {
        let n = self.length(field, 1)?;
        self.bytes(field, n)
    }

    pub fn text(&mut self, field: &'static str) -> Result<String, MessageFault> {
        let bytes = self.blob(field)?;
        let bytes = if self.is_cdr { bytes.strip_suffix(b"\0").unwrap_or(bytes) } else { bytes };
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    /// ns since the Unix epoch.
    pub fn time(&mut self, field: &'static str) -> Result<i64, MessageFault> {
        let seconds = self.u32(field)?;
        let nanos = self.u32(field)?;
        // Signed in ROS 2, unsigned in ROS 1.
        let seconds = if self.is_cdr { i64::from(seconds as i32) } else { i64::from(seconds) };
        Ok(seconds * 1_000_000_000 + i64::from(nanos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_numbers_are_aligned_and_swapped_by_the_encapsulation() {
        let little =
            [&[0, 1, 0, 0, 7, 9, 9, 9][..], &2_u32.to_le_bytes(), b"a\0", &[0; 6], &0.5_f64.to_le_bytes()].concat();
        let big =
            [&[0, 0, 0, 0, 7, 9, 9, 9][..], &2_u32.to_be_bytes(), b"a\0", &[0; 6], &0.5_f64.to_be_bytes()].concat();
        // CDR 2 aligns to 4 at most.
        let second =
            [&[0, 7, 0, 0, 7, 9, 9, 9][..], &2_u32.to_le_bytes(), b"a\0", &[0; 2], &0.5_f64.to_le_bytes()].concat();
        for message in [little, big, second] {
            let mut cursor = Cursor::new(Encoding::Cdr, &message).expect("is CDR");
            assert_eq!(cursor.u8("a"), Ok(7));
            assert_eq!(cursor.text("b").as_deref(), Ok("a"));
            assert_eq!(cursor.f64("c"), Ok(0.5));
            assert_eq!(cursor.u8("d"), Err(MessageFault::End { field: "d", n_bytes: message.len() }));
        }
        assert_eq!(Cursor::new(Encoding::Cdr, &[0, 3, 0, 0]).expect_err("is refused"), MessageFault::Encapsulation(3));
    }

    #[test]
    fn ros1_numbers_are_packed() {
        let message = [&[7][..], &1_u32.to_le_bytes(), b"a", &5_u32.to_le_bytes(), &6_u32.to_le_bytes()].concat();
        let mut cursor = Cursor::new(Encoding::Ros1, &message).expect("opens");
        assert_eq!((cursor.u8("a"), cursor.text("b").as_deref()), (Ok(7), Ok("a")));
        assert_eq!(cursor.time("c"), Ok(5_000_000_006));
        assert!(cursor.u8("d").is_err());
    }

    #[test]
    fn lengths_beyond_the_message_are_refused() {
        let message = [&[0, 1, 0, 0][..], &u32::MAX.to_le_bytes(), b"abc"].concat();
        let mut cursor = Cursor::new(Encoding::Cdr, &message).expect("opens");
        assert!(cursor.clone().length("a", 1).is_err());
        assert!(cursor.clone().blob("a").is_err());
        assert!(cursor.text("a").is_err());
    }
}
