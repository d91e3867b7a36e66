//! Clouds as text: one point per line, numbers between spaces, tabs, commas or semicolons.

use crate::error::{At, ImportError};
use files::regular_file;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Longest line, bytes: twenty numbers of twenty digits.
const MAX_LINE: usize = 1 << 10;
/// Minimum number of values of a line: x y z and a class.
const MIN_NUMBERS: usize = 4;
/// Maximum number of lines with a title or a count before the points.
const MAX_TITLE_LINES: usize = 2;
/// Largest class of `Street3D`.
const MAX_CLASS: f64 = 5.0;

/// Passes the numbers of each line of a file to `take`. All lines have as many numbers as the first line with at least
/// four; earlier lines are titles.
pub(super) fn each_row(
    file: &Path,
    mut take: impl FnMut(&[f64]) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let mut reader = BufReader::with_capacity(1 << 20, plain(file, regular_file::open(file).at(file)?));
    let mut line = Vec::new();
    let mut values = Vec::new();
    let mut n_values = 0;
    let mut number = 0;
    loop {
        line.clear();
        number += 1;
        if (&mut reader).take(MAX_LINE as u64 + 1).read_until(b'\n', &mut line).at(file)? == 0 {
            return Ok(());
        }
        if line.len() > MAX_LINE {
            return Err(ImportError::at_line(file, number, format!("has more than {MAX_LINE} bytes")));
        }
        values.clear();
        let is_read = read_numbers(&line, &mut values);
        if line.trim_ascii().is_empty() || (n_values == 0 && number <= MAX_TITLE_LINES && values.len() < MIN_NUMBERS) {
            continue;
        }
        let is_first = n_values == 0;
        if !is_read || values.len() < MIN_NUMBERS || (!is_first && values.len() != n_values) {
            let found = String::from_utf8_lossy(line.trim_ascii()).into_owned();
            let rule = match n_values {
                0 => "at least four numbers, x y z first and the class last".to_owned(),
                n => format!("{n} numbers, as in the previous lines"),
            };
            return Err(ImportError::at_line(file, number, format!("{found:?} must be {rule}")));
        }
        n_values = values.len();
        take(&values)?;
    }
}

/// The text of a file, which may be compressed by gzip.
fn plain(file: &Path, content: File) -> Box<dyn Read> {
    let is_compressed = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    if is_compressed { Box::new(MultiGzDecoder::new(content)) } else { Box::new(content) }
}

/// Reads up to the first word that is not a number. `false` if there is such a word.
fn read_numbers(line: &[u8], values: &mut Vec<f64>) -> bool {
    let Ok(text) = std::str::from_utf8(line) else { return false };
    let words = text.split(|c: char| c.is_ascii_whitespace() || c == ',' || c == ';').filter(|word| !word.is_empty());
    for word in words {
        let Ok(value) = word.parse() else { return false };
        values.push(value);
    }
    true
}

/// Whether the first lines of a file are points with a class.
pub(super) fn begins_as_cloud(file: &Path) -> bool {
    let mut n = 0;
    // Stops at the third point.
    let _ = each_row(file, |values| {
        let class = values[values.len() - 1];
        let is_class = class.fract() == 0.0 && (0.0..=MAX_CLASS).contains(&class);
        if !is_class || n == 2 {
            return Err(ImportError::at(file, "enough is read"));
        }
        n += 1;
        Ok(())
    });
    n >= 2
}
