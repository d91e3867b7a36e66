//! Stamps of sweeps: from a table in their folder or next to it, otherwise from their names.

use super::find_file;
use crate::error::{At, ImportError};
use crate::stamp_text::{nanos, nanos_of_name, unquoted};
use files::names::{natural_order, numbers};
use files::text_file::read_long_text;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names of tables.
const TABLES: [&str; 5] = ["times.txt", "timestamps.txt", "stamps.txt", "times.csv", "timestamps.csv"];

/// Least median time between sweeps, ns: no LiDAR has more than 500 sweeps per second.
const MIN_INTERVAL_NANOS: i64 = 2_000_000;
/// Names of columns that contain ns past a whole second.
const NANOS_COLUMNS: [&str; 5] = ["nsec", "nsecs", "nanosec", "nanoseconds", "nanos"];

/// Sweeps in the order of their stamps.
pub(super) struct Stamped {
    pub files: Vec<(String, PathBuf)>,
    /// `None`: the source has no times.
    pub times: Option<Vec<i64>>,
    /// The table, if there is one.
    pub table: Option<PathBuf>,
    /// Line of the report: the numbers in the names contradict the stamps.
    pub note: Option<String>,
}

/// Finds the stamps of files that are sorted by name.
pub(super) fn stamped(source: &Path, files: Vec<(String, PathBuf)>) -> Result<Stamped, ImportError> {
    let table = find_file(source, &TABLES)?;
    let stamps: Option<Vec<i64>> = match &table {
        Some(path) => Some(read_table(path, &files)?),
        None => files.iter().map(|(name, _)| nanos_of_name(stem(name))).collect(),
    };
    let Some(stamps) = stamps else { return Ok(Stamped { files, times: None, table, note: None }) };
    let note = contradiction(&files, &stamps);
    let mut both: Vec<(i64, (String, PathBuf))> = stamps.into_iter().zip(files).collect();
    both.sort_by(|a, b| a.0.cmp(&b.0).then_with(|| natural_order(&a.1.0, &b.1.0)));
    if let Some(pair) = both.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(ImportError::at(&pair[1].1.1, format!("has the stamp of {}, {} ns", pair[0].1.0, pair[0].0)));
    }
    let place = table.as_deref().unwrap_or(source);
    if table.is_none() {
        let decimals = |(_, (name, path)): &(i64, (String, PathBuf))| {
            let (_, digits) = stem(name).rsplit('_').next()?.split_once('.')?;
            Some(Decimals { place: path.clone(), digits: digits.to_owned() })
        };
        let all: Vec<_> = both.iter().filter_map(decimals).collect();
        if let Some(found) = unpadded(&all) {
            return Err(ImportError::at(&found.place, found.rule()));
        }
    }
    let (times, files): (Vec<i64>, Vec<_>) = both.into_iter().unzip();
    check_intervals(place, &times)?;
    Ok(Stamped { files, times: Some(times), table, note })
}

/// Fails if there are more sweeps per second than any LiDAR measures: the unit of the stamps is another one.
fn check_intervals(place: &Path, times: &[i64]) -> Result<(), ImportError> {
    let mut intervals: Vec<i64> = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    intervals.sort_unstable();
    match intervals.get(intervals.len() / 2) {
        Some(median) if *median < MIN_INTERVAL_NANOS => Err(ImportError::at(
            place,
            format!(
                "{} stamps from {} to {} ns have a median interval of {median} ns; sweeps are at least {MIN_INTERVAL_NANOS} ns \
                 apart: check the unit and the decimals of the stamps",
                times.len(),
                times[0],
                times[times.len() - 1]
            ),
        )),
        _ => Ok(()),
    }
}

/// Decimals of a stamp, and where it stands.
struct Decimals<P> {
    place: P,
    digits: String,
}

/// Stamps such as `1700000000.5000000` may contain seconds and ns without leading zeros instead of decimals: the decimals have
/// different lengths, none begins with a zero, and some end with one. The first of these.
fn unpadded<P>(all: &[Decimals<P>]) -> Option<&Decimals<P>> {
    let lengths = || all.iter().map(|decimals| decimals.digits.len());
    let longest = lengths().max()?;
    let has_leading = all.iter().any(|decimals| decimals.digits.len() > 1 && decimals.digits.starts_with('0'));
    if lengths().min() == Some(longest) || has_leading {
        return None;
    }
    all.iter().find(|Decimals { digits, .. }| (2..longest).contains(&digits.len()) && digits.ends_with('0'))
}

impl<P> Decimals<P> {
    fn rule(&self) -> String {
        let digits = &self.digits;
        format!(
            "the decimals {digits:?} may be a number of ns without leading zeros: other stamps have more digits. Write all stamps with 9 \
             decimals"
        )
    }
}

/// Line of the report if sweeps are counted and their stamps have another order.
fn contradiction(files: &[(String, PathBuf)], stamps: &[i64]) -> Option<String> {
    numbers(files.iter().map(|(name, _)| name.as_str()))?;
    let at = stamps.windows(2).position(|pair| pair[1] < pair[0])?;
    Some(format!(
        "the numbers in the names contradict the stamps: {} has {} ns, {} has {} ns; the order of the stamps is used",
        files[at].0,
        stamps[at],
        files[at + 1].0,
        stamps[at + 1]
    ))
}

fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// The stamp of a line. `file`: the word that is the name of a sweep. `has_nanos`: the header names a column of ns past a second.
fn stamp_of(words: &[&str], file: Option<usize>, has_nanos: bool) -> Result<Option<i64>, String> {
    let others: Vec<&str> =
        words.iter().enumerate().filter(|(at, _)| Some(*at) != file).map(|(_, word)| *word).collect();
    let stamp = |word: &&str| nanos(word).or_else(|| decimal_comma(word));
    let Some(at) = others.iter().position(|word| stamp(word).is_some()) else { return Ok(None) };
    let found = stamp(&others[at]);
    let is_digits = |word: &str| !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
    // A whole second and digits: ns, or the decimals after a decimal comma.
    let Some(next) =
        others.get(at + 1).filter(|next| others[at].len() <= 10 && is_digits(others[at]) && is_digits(next))
    else {
        return Ok(found);
    };
    if next.len() == 9 || has_nanos && next.len() < 9 {
        return Ok(found.zip(next.parse::<i64>().ok()).map(|(second, nanos)| second + nanos));
    }
    Err(format!(
        "{:?} and {next:?} may be seconds and ns, or a number with a decimal comma: write seconds with a decimal point, name the \
         column nsec, or write ns with 9 digits",
        others[at]
    ))
}

/// Whether a header, which may be a comment, names a column of ns past a second.
fn names_nanos(header: &str) -> bool {
    let mut words = header.split(|c: char| !c.is_ascii_alphanumeric());
    words.any(|word| NANOS_COLUMNS.contains(&word.to_lowercase().as_str()))
}

/// The stamp of seconds with a decimal comma.
fn decimal_comma(word: &str) -> Option<i64> {
    let (whole, decimals) = word.split_once(',')?;
    nanos(&format!("{whole}.{decimals}"))
}

/// Stamps by line, or by the names of the sweeps if the lines contain them.
fn read_table(path: &Path, files: &[(String, PathBuf)]) -> Result<Vec<i64>, ImportError> {
    let text = read_long_text(path).at(path)?;
    let names: BTreeMap<&str, usize> =
        files.iter().enumerate().flat_map(|(index, (name, _))| [(name.as_str(), index), (stem(name), index)]).collect();
    let mut by_name: Vec<Option<i64>> = vec![None; files.len()];
    let mut in_order: Vec<i64> = Vec::new();
    let mut has_header = false;
    let mut has_nanos = false;
    let mut decimals: Vec<Decimals<usize>> = Vec::new();
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        if line.is_empty() || line.starts_with('#') {
            has_nanos |= names_nanos(line);
            continue;
        }
        // Next to other separators, a comma is a decimal comma.
        let separators: &[char] = if line.contains([';', '\t']) { &[';', '\t'] } else { &[','] };
        let words: Vec<&str> = line.split(separators).map(unquoted).collect();
        // Dates contain a space, so a line is first parsed as one stamp.
        let words = if words.len() == 1 && nanos(line).is_none() { line.split_whitespace().collect() } else { words };
        let file =
            words.iter().position(|word| names.contains_key(*word) && (words.len() > 1 || nanos(word).is_none()));
        let mut with_decimals =
            words.iter().enumerate().filter(|(at, word)| Some(*at) != file && nanos(word).is_some());
        let of_line = with_decimals.find_map(|(_, word)| word.split_once('.'));
        decimals.extend(of_line.map(|(_, digits)| Decimals { place: number, digits: digits.to_owned() }));
        let stamp = stamp_of(&words, file, has_nanos).map_err(|rule| ImportError::at_line(path, number, rule))?;
        let Some(stamp) = stamp else {
            let is_header = !has_header && in_order.is_empty() && by_name.iter().all(Option::is_none);
            if is_header && line.contains(|c: char| c.is_ascii_alphabetic()) {
                has_header = true;
                has_nanos |= names_nanos(line);
                continue;
            }
            let rule = "must be a stamp: seconds with decimals, a date, or an integer since 1970 in s, ms, us or ns";
            return Err(ImportError::at_line(path, number, format!("{line:?} {rule}")));
        };
        if let Some(at) = file {
            by_name[names[words[at]]] = Some(stamp);
        } else {
            if let Some(previous) = in_order.last().filter(|previous| **previous > stamp) {
                let rule = format!(
                    "stamp {stamp} ns is {:.6} s before the previous one, {previous} ns; stamps without names must increase: \
                         write the name of its sweep on each line, or correct the stamps",
                    previous.saturating_sub(stamp) as f64 * 1e-9
                );
                return Err(ImportError::at_line(path, number, rule));
            }
            in_order.push(stamp);
        }
    }
    if let Some(found) = unpadded(&decimals) {
        return Err(ImportError::at_line(path, found.place, found.rule()));
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
