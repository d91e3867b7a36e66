//! Natural order of file names: numbers in names count by their value, so `2.pcd` comes before `10.pcd`.

use std::cmp::Ordering;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Sorts files of one folder by name in natural order.
pub fn sort_by_name(paths: &mut [PathBuf]) {
    paths.sort_by(|a, b| natural_path_order(a, b));
}

/// Natural order of two paths: of their folders, then of their names.
pub fn natural_path_order(a: &Path, b: &Path) -> Ordering {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    a.parent().cmp(&b.parent()).then_with(|| natural_order(&name(a), &name(b))).then_with(|| a.cmp(b))
}

/// Natural order of two names. Names whose numbers have equally many digits are in the order of their bytes.
///
/// Two numbers with a point between them, at the start of a name or after `_`, are decimal seconds: `5.25.pcd` comes before
/// `5.5.pcd`. All other numbers are integers.
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (Parts::new(a), Parts::new(b));
    loop {
        let order = match (left.next(), right.next()) {
            (None, None) => return a.cmp(b),
            (None, Some(_)) => return Ordering::Less,
            (Some(_), None) => return Ordering::Greater,
            (Some(Part::Number(x)), Some(Part::Number(y))) => by_value(x, y),
            (Some(Part::Decimals(x)), Some(Part::Decimals(y))) => x.trim_end_matches('0').cmp(y.trim_end_matches('0')),
            (Some(x), Some(y)) => x.text().cmp(y.text()),
        };
        if order.is_ne() {
            return order;
        }
    }
}

/// The numbers by which files are counted, if their names differ in one integer only: the same text before it and after it.
/// A `.pcap` before `.pcap1` has the number 0, as `tcpdump -C` names its files. `None` for fewer than two files, for other
/// names, and for numbers that do not fit in 64 bits.
pub fn numbers<'a>(names: impl IntoIterator<Item = &'a str>) -> Option<Vec<u64>> {
    let names: Vec<&str> = names.into_iter().collect();
    let (first, others) = names.split_first()?;
    let other = others.iter().find(|other| other != &first)?;
    // The integer in which the first two names differ; a name without it ends where the integer would begin.
    let common = first.bytes().zip(other.bytes()).take_while(|(a, b)| a == b).count();
    let start = first[..floor(first, common)].trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (head, rest) = first.split_at(start);
    let end = |rest: &str| rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    let longer = if rest.is_empty() { &other[start..] } else { rest };
    let tail = &longer[end(longer)..];
    let number = |name: &&str| {
        let digits = name.strip_prefix(head)?.strip_suffix(tail)?;
        match digits {
            "" if tail.is_empty() && !head.is_empty() => Some(0),
            _ if digits.bytes().all(|byte| byte.is_ascii_digit()) => digits.parse().ok(),
            _ => None,
        }
    };
    names.iter().map(number).collect()
}

/// Ranges of numbers that are missing between the smallest and the largest number, each with the index of the file before
/// it. `numbers` must be sorted.
pub fn missing(numbers: &[u64]) -> Vec<(usize, Range<u64>)> {
    let gap = |(index, pair): (usize, &[u64])| (index, pair[0].saturating_add(1)..pair[1]);
    numbers.windows(2).enumerate().map(gap).filter(|(_, gap)| !gap.is_empty()).collect()
}

/// The last boundary of a character up to byte `at`.
fn floor(text: &str, at: usize) -> usize {
    (0..=at.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// Order of two texts of digits by their value.
fn by_value(a: &str, b: &str) -> Ordering {
    let (a, b) = (a.trim_start_matches('0'), b.trim_start_matches('0'));
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

/// A part of a name.
enum Part<'a> {
    Number(&'a str),
    /// Digits after a decimal point.
    Decimals(&'a str),
    /// A single other character.
    Other(&'a str),
}

impl<'a> Part<'a> {
    fn text(&self) -> &'a str {
        match self {
            Self::Number(text) | Self::Decimals(text) | Self::Other(text) => text,
        }
    }
}

/// Splits a name into numbers and single characters.
struct Parts<'a> {
    name: &'a str,
    at: usize,
}

impl<'a> Parts<'a> {
    fn new(name: &'a str) -> Self {
        Self { name, at: 0 }
    }

    /// Whether the digits from `at` to `end` follow a decimal point.
    fn are_decimals(&self, end: usize) -> bool {
        let Some(whole) = self.name[..self.at].strip_suffix('.') else { return false };
        let before = whole.trim_end_matches(|c: char| c.is_ascii_digit());
        let has_whole = before.len() < whole.len() && (before.is_empty() || before.ends_with('_'));
        let rest = &self.name.as_bytes()[end..];
        // Three numbers with points are a version or a date.
        let is_chain = rest.first() == Some(&b'.') && rest.get(1).is_some_and(u8::is_ascii_digit);
        has_whole && !is_chain
    }
}

impl<'a> Iterator for Parts<'a> {
    type Item = Part<'a>;

    fn next(&mut self) -> Option<Part<'a>> {
        let rest = &self.name[self.at..];
        let first = rest.chars().next()?;
        let length = match first {
            '0'..='9' => rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len()),
            _ => first.len_utf8(),
        };
        let text = &rest[..length];
        let part = match first {
            '0'..='9' if self.are_decimals(self.at + length) => Part::Decimals(text),
            '0'..='9' => Part::Number(text),
            _ => Part::Other(text),
        };
        self.at += length;
        Some(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn in_order(names: &[&str]) {
        let mut paths: Vec<PathBuf> = names.iter().rev().map(PathBuf::from).collect();
        sort_by_name(&mut paths);
        assert_eq!(paths, names.iter().map(PathBuf::from).collect::<Vec<_>>());
    }

    #[test]
    fn numbers_in_names_count_by_value() {
        in_order(&["0.pcd", "1.pcd", "2.pcd", "10.pcd", "11.pcd", "100.pcd"]);
        in_order(&["full0.pcd", "full1.pcd", "full2.pcd", "full10.pcd"]);
        in_order(&["cap.pcap", "cap.pcap1", "cap.pcap2", "cap.pcap10", "cap.pcap11"]);
        in_order(&["a_2_3.bin", "a_2_10.bin", "a_10_1.bin"]);
        in_order(&["99999999999999999999998.pcd", "99999999999999999999999.pcd", "100000000000000000000000.pcd"]);
        in_order(&["1700000000_5.pcd", "1700000000_40.pcd", "1700000001_3.pcd"]);
        in_order(&["v1.2.3.pcd", "v1.2.10.pcd"]);
        // Equally many digits: the order of the bytes, as before.
        in_order(&["000000.pcd", "000001.pcd", "000010.pcd"]);
        // The same value: the name decides.
        in_order(&["01.pcd", "1.pcd", "2.pcd"]);
        in_order(&["ä2.pcd", "ä10.pcd"]);
    }

    #[test]
    fn decimal_seconds_in_names_are_not_integers() {
        in_order(&["5.25.pcd", "5.5.pcd", "10.125.pcd"]);
        in_order(&["1700000000.05.pcd", "1700000000.1.pcd", "1700000000.15.pcd", "1700000001.0.pcd"]);
        in_order(&["scan_5.25.pcd", "scan_5.5.pcd"]);
    }

    #[test]
    fn numbers_of_counted_files_and_gaps_are_found() {
        let found = |names: &[&str]| numbers(names.iter().copied());
        assert_eq!(found(&["f0.pcd", "f1.pcd", "f10.pcd"]), Some(vec![0, 1, 10]));
        assert_eq!(found(&["000001.pcd", "000002.pcd"]), Some(vec![1, 2]));
        assert_eq!(found(&["x.pcap", "x.pcap1", "x.pcap12"]), Some(vec![0, 1, 12]));
        assert_eq!(found(&["x.pcap1", "x.pcap", "x.pcap12"]), Some(vec![1, 0, 12]));
        assert_eq!(found(&["x10.pcd", "x1.pcd"]), Some(vec![10, 1]));
        for names in [&["a.pcap", "b.pcap"][..], &["a1b2.pcd", "a2b1.pcd"], &["a.pcap"], &[], &["a1", "ab"]] {
            assert_eq!(found(names), None, "{names:?}");
        }
        assert_eq!(missing(&[0, 1, 4, 5, 7]), [(1, 2..4), (3, 6..7)]);
        assert!(missing(&[3, 4]).is_empty() && missing(&[]).is_empty());
    }
}
