//! Stamps of sweeps: from a table in their folder or next to it, otherwise from their names.

use super::find_file;
use crate::error::{At, ImportError};
use crate::stamp_text::{nanos, nanos_of_name};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Names of tables.
const TABLES: [&str; 5] = ["times.txt", "timestamps.txt", "stamps.txt", "times.csv", "timestamps.csv"];

/// Sweeps in the order of their stamps.
pub(super) struct Stamped {
    pub files: Vec<(String, PathBuf)>,
    /// `None`: the source has no times.
    pub times: Option<Vec<i64>>,
    /// The table, if there is one.
    pub table: Option<PathBuf>,
}

/// Finds the stamps of files that are sorted by name.
pub(super) fn stamped(source: &Path, files: Vec<(String, PathBuf)>) -> Result<Stamped, ImportError> {
    let table = find_file(source, &TABLES)?;
    let stamps: Option<Vec<i64>> = match &table {
        Some(path) => Some(read_table(path, &files)?),
        None => files.iter().map(|(name, _)| nanos_of_name(stem(name))).collect(),
    };
    let Some(stamps) = stamps else { return Ok(Stamped { files, times: None, table }) };
    let mut both: Vec<(i64, (String, PathBuf))> = stamps.into_iter().zip(files).collect();
    both.sort();
    if let Some(pair) = both.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(ImportError::at(&pair[1].1.1, format!("has the stamp of {}, {} ns", pair[0].1.0, pair[0].0)));
    }
    let (times, files) = both.into_iter().unzip();
    Ok(Stamped { files, times: Some(times), table })
}

fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Stamps by line, or by the names of the sweeps if the lines contain them.
fn read_table(path: &Path, files: &[(String, PathBuf)]) -> Result<Vec<i64>, ImportError> {
    let text = fs::read_to_string(path).at(path)?;
    let names: BTreeMap<&str, usize> =
        files.iter().enumerate().flat_map(|(index, (name, _))| [(name.as_str(), index), (stem(name), index)]).collect();
    let mut by_name: Vec<Option<i64>> = vec![None; files.len()];
    let mut in_order = Vec::new();
    let mut has_header = false;
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        // Dates contain a space, so a line is first parsed as one stamp.
        let words = if words.len() == 1 && nanos(line).is_none() { line.split_whitespace().collect() } else { words };
        let file =
            words.iter().position(|word| names.contains_key(*word) && (words.len() > 1 || nanos(word).is_none()));
        let stamp = words.iter().enumerate().filter(|(at, _)| Some(*at) != file).find_map(|(_, word)| nanos(word));
        let Some(stamp) = stamp else {
            let is_header = !has_header && in_order.is_empty() && by_name.iter().all(Option::is_none);
            if is_header && line.contains(|c: char| c.is_ascii_alphabetic()) {
                has_header = true;
                continue;
            }
            let rule = "must be a stamp: seconds with decimals, a date, or an integer since 1970 in s, ms, us or ns";
            return Err(ImportError::at_line(path, number, format!("{line:?} {rule}")));
        };
        match file {
            Some(at) => by_name[names[words[at]]] = Some(stamp),
            None => in_order.push(stamp),
        }
    }
    if by_name.iter().any(Option::is_some) {
        let absent = by_name.iter().position(Option::is_none);
        if let Some(index) = absent.or((!in_order.is_empty()).then_some(0)) {
            return Err(ImportError::at(
                path,
                format!("must have a line with the name of each sweep, as {}", files[index].0),
            ));
        }
        return Ok(by_name.into_iter().flatten().collect());
    }
    if in_order.len() != files.len() {
        return Err(ImportError::at(path, format!("{} stamps for {} sweeps", in_order.len(), files.len())));
    }
    Ok(in_order)
}
