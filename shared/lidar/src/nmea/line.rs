//! Finds sentences in the lines of a log.
//!
//! Loggers write a time, a tag block (`\\c:1700000000*5B\\`) or nothing in front of a sentence. Receivers send binary messages (UBX, RTCM)
//! between sentences, and a binary message has no line end. Therefore a sentence is searched in its line.

use super::sentence::{Checked, NmeaError, Sentence, checked};
use std::borrow::Cow;

/// Content of a line.
#[derive(Debug, PartialEq)]
pub(super) enum Content {
    /// White space, or a comment that starts with `#`.
    Empty,
    /// Bytes that are neither text nor a sentence.
    Binary,
    /// Text that is not a sentence.
    Text,
    /// Sentences; more than one if a line end is lost.
    Sentences(Vec<Found>),
}

/// A sentence in a line.
#[derive(Debug, PartialEq)]
pub(super) struct Found {
    /// Offset of the `$`.
    pub(super) begin: usize,
    /// Offset after the checksum, or after the last field.
    pub(super) end: usize,
    pub(super) parsed: Result<Checked, NmeaError>,
}

/// Parses the first valid sentence of a line.
pub fn parse(line: &str) -> Result<Sentence, NmeaError> {
    sentence(line.as_bytes())
}

/// The first valid sentence of a line of bytes.
pub fn sentence(line: &[u8]) -> Result<Sentence, NmeaError> {
    let Content::Sentences(mut found) = content(line) else { return Err(NmeaError::Frame) };
    let valid = found.iter().find_map(|found| found.parsed.as_ref().ok());
    match valid {
        Some(valid) => Ok(valid.sentence),
        None => found.swap_remove(0).parsed.map(|checked| checked.sentence),
    }
}

/// The content of a line.
pub(super) fn content(line: &[u8]) -> Content {
    let is_blank = |byte: &u8| byte.is_ascii_whitespace() || *byte == 0;
    let Some(first) = line.iter().position(|byte| !is_blank(byte)) else { return Content::Empty };
    let begins: Vec<usize> = (first..line.len()).filter(|at| is_begin(&line[*at..])).collect();
    if begins.is_empty() {
        return without_sentence(&line[first..]);
    }
    let ends = begins.iter().skip(1).copied().chain([line.len()]);
    let found = begins.iter().zip(ends).map(|(begin, next)| found(line, *begin, next));
    Content::Sentences(found.collect())
}

/// Whether a sentence may start here: `$` or `!`, then letters and digits of a name.
fn is_begin(bytes: &[u8]) -> bool {
    match bytes {
        [b'$' | b'!', first, second, third, ..] => {
            first.is_ascii_uppercase()
                && [second, third].iter().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit())
        }
        _ => false,
    }
}

/// The sentence between `begin` and the start of the next one.
fn found(line: &[u8], begin: usize, next: usize) -> Found {
    let bytes = &line[begin..next];
    // Behind the checksum follow the line end, binary messages, or what a logger appends.
    let sum = bytes.iter().position(|byte| *byte == b'*').map(|star| star + 3);
    let end = sum.filter(|end| *end <= bytes.len()).unwrap_or(bytes.len() - trailing_blanks(bytes));
    let parsed = std::str::from_utf8(&bytes[1..end]).map_err(|_| NmeaError::Frame).and_then(checked);
    Found { begin, end: begin + end, parsed }
}

fn trailing_blanks(bytes: &[u8]) -> usize {
    bytes.iter().rev().take_while(|byte| byte.is_ascii_whitespace() || **byte == 0).count()
}

/// The content of a line in which no sentence starts.
fn without_sentence(line: &[u8]) -> Content {
    let contains = |name: &[u8]| line.windows(name.len()).any(|window| window == name);
    let is_text = line.iter().all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace() || *byte == 0);
    match line[0] {
        b'#' if is_text => Content::Empty,
        // A sentence with a damaged name.
        _ if is_text || contains(b"GGA,") || contains(b"RMC,") => Content::Text,
        _ => Content::Binary,
    }
}

/// The log as bytes of ASCII characters: UTF-16 is converted, and a byte order mark is removed.
pub(super) fn decoded(log: &[u8]) -> Cow<'_, [u8]> {
    let utf16 = |unit: fn([u8; 2]) -> u16, bytes: &[u8]| {
        // A character outside of ASCII damages its sentence.
        let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        Cow::Owned(units.map(|unit| u8::try_from(unit).unwrap_or(0xff)).collect())
    };
    match log {
        [0xff, 0xfe, rest @ ..] => utf16(u16::from_le_bytes, rest),
        [0xfe, 0xff, rest @ ..] => utf16(u16::from_be_bytes, rest),
        [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
        // Without a mark: each second byte of the first characters is zero.
        [b'$', 0, _, 0, ..] => utf16(u16::from_le_bytes, log),
        [0, b'$', 0, _, ..] => utf16(u16::from_be_bytes, log),
        _ => Cow::Borrowed(log),
    }
}

/// A line with its number, from 1.
pub(super) struct Line<'a> {
    pub(super) number: u64,
    pub(super) text: &'a [u8],
}

/// The lines of a log. Lines end with LF or CR LF; in a log without LF, with CR.
pub(super) fn lines(log: &[u8]) -> impl Iterator<Item = Line<'_>> {
    let end = if log.contains(&b'\n') { b'\n' } else { b'\r' };
    let lines = log.split(move |byte| *byte == end);
    (1..).zip(lines).map(|(number, text)| Line { number, text })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmea::sentence::Zda;
    use geometry::Stamp;

    const ZDA: &str = "$GPZDA,201530.00,04,07,2002,00,00*60";

    fn zda() -> Sentence {
        Sentence::Zda(Zda { stamp: Some(Stamp(1_025_813_730_000_000_000)) })
    }

    #[test]
    fn sentence_is_found_behind_times_tag_blocks_and_binary_messages() {
        for before in ["", "1700000000.123,", "\\c:1700000000*5B\\", "\u{feff}", "[12:00:01] "] {
            assert_eq!(parse(&format!("{before}{ZDA}\r\n")), Ok(zda()), "{before}");
        }
        // UBX-NAV-TIMEUTC, then RTCM 1005, with a $ of their own.
        let mut bytes = b"\xb5\x62\x01\x21\x14\x00$A\x80\xff\x00".to_vec();
        bytes.extend(b"\xd3\x00\x13\x3e\xd0$$");
        assert_eq!(content(&bytes), Content::Binary);
        bytes.extend(ZDA.as_bytes());
        bytes.extend(b"\r");
        assert_eq!(sentence(&bytes), Ok(zda()));
        assert_eq!(content(b"\xb5\x62\x01\x07\x5c\x00"), Content::Binary);
        assert_eq!(content(b"\x00\x00 \r"), Content::Empty);
        assert_eq!(content(b"# a comment"), Content::Empty);
        assert_eq!(content(b"log opened"), Content::Text);
        assert_eq!(content(b"\xa4GPGGA,120000"), Content::Text);
    }

    #[test]
    fn two_sentences_in_a_line_are_two() {
        let line = format!("$GPGGA,1203{ZDA}{ZDA}");
        let Content::Sentences(found) = content(line.as_bytes()) else { panic!("no sentences") };
        assert_eq!(found.iter().map(|found| found.parsed.is_ok()).collect::<Vec<_>>(), [false, true, true]);
        assert_eq!(&line[found[1].begin..found[1].end], ZDA);
        assert_eq!(parse(&line), Ok(zda()));
    }

    #[test]
    fn logs_of_any_encoding_and_line_end_have_the_same_lines() {
        let text = format!("{ZDA}\r\n{ZDA}\r\n");
        let utf16 = |unit: fn(u16) -> [u8; 2], mark: &str| -> Vec<u8> {
            format!("{mark}{text}").encode_utf16().flat_map(unit).collect()
        };
        let logs = [
            text.clone().into_bytes(),
            format!("\u{feff}{text}").into_bytes(),
            text.replace("\r\n", "\r").into_bytes(),
            utf16(u16::to_le_bytes, "\u{feff}"),
            utf16(u16::to_be_bytes, "\u{feff}"),
            utf16(u16::to_le_bytes, ""),
            utf16(u16::to_be_bytes, ""),
        ];
        for log in logs {
            let log = decoded(&log);
            let read: Vec<_> = lines(&log).filter_map(|line| Some((line.number, sentence(line.text).ok()?))).collect();
            assert_eq!(read, [(1, zda()), (2, zda())], "{log:?}");
        }
    }
}
