//! Cells of tables that other programs read.

use std::borrow::Cow;

/// First characters that spreadsheets take for the start of a formula.
const FORMULA: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];
/// Characters that require quotes (RFC 4180).
const QUOTED: [char; 4] = [',', '"', '\n', '\r'];

/// A text as one cell of a CSV file, for texts that the program does not choose, such as names in the files of a user. A text
/// that a spreadsheet would run as a formula gets an apostrophe in front; separators and quotes are quoted.
pub fn csv_cell(text: &str) -> Cow<'_, str> {
    let text = if text.starts_with(FORMULA) { Cow::Owned(format!("'{text}")) } else { Cow::Borrowed(text) };
    if text.contains(QUOTED) { Cow::Owned(format!("\"{}\"", text.replace('"', "\"\""))) } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_of_a_foreign_text_is_one_cell_and_no_formula() {
        for (text, cell) in [
            ("P1", "P1"),
            ("Straße 5 =", "Straße 5 ="),
            ("=HYPERLINK(\"http://a\",\"b\")", "\"'=HYPERLINK(\"\"http://a\"\",\"\"b\"\")\""),
            ("+1", "'+1"),
            ("-12", "'-12"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("\tx", "'\tx"),
            ("a,b", "\"a,b\""),
            ("a\"b", "\"a\"\"b\""),
            ("", ""),
        ] {
            assert_eq!(csv_cell(text), cell, "{text:?}");
        }
    }
}
