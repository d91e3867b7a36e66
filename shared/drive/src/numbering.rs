//! Counted files: numbers in the names of sweeps or captures, and numbers that are missing.

use files::names::{missing, numbers};
use std::path::{Path, PathBuf};

/// Files that are missing in a counted series.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Missing {
    /// Number of missing files.
    pub n_files: u64,
    /// One text per gap: the files around it and the missing numbers.
    pub texts: Vec<String>,
}

/// Most numbers of a series for each file that is there.
const MAX_NUMBERS_PER_FILE: u64 = 100;

/// Position of each file in its series, from 0: the number in its name in steps of the series. `None` if the names are not
/// counted, or not in this order.
///
/// A series has a step that divides all differences and is at least half of them. So times in names are not a series, nor are
/// files of which almost all numbers would be missing.
pub(super) fn positions(files: &[PathBuf]) -> Option<Vec<u64>> {
    let names: Vec<String> = files.iter().map(|path| name(path)).collect();
    let numbers = numbers(names.iter().map(String::as_str)).filter(|numbers| numbers.is_sorted_by(|a, b| a < b))?;
    let steps: Vec<u64> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let step = steps.iter().copied().fold(0, gcd);
    let n_single = steps.iter().filter(|other| **other == step).count();
    let is_series = step > 0 && n_single * 2 >= steps.len();
    let positions = is_series.then(|| numbers.iter().map(|number| (number - numbers[0]) / step).collect::<Vec<_>>());
    positions
        .filter(|positions| positions.last().is_some_and(|last| *last <= MAX_NUMBERS_PER_FILE * files.len() as u64))
}

/// The missing files of a series of files.
pub(super) fn missing_files(files: &[PathBuf]) -> Missing {
    let Some(positions) = positions(files) else { return Missing::default() };
    let gaps = missing(&positions);
    let text = |(before, gap): &(usize, std::ops::Range<u64>)| {
        let n = gap.end - gap.start;
        let [before, after] = [&files[*before], &files[before + 1]];
        let size = |path: &Path| path.metadata().map_or(0, |metadata| metadata.len());
        format!(
            "by the numbers in the names, {n} between {} ({} bytes) and {} ({} bytes)",
            name(before),
            size(before),
            name(after),
            size(after)
        )
    };
    Missing { n_files: gaps.iter().map(|(_, gap)| gap.end - gap.start).sum(), texts: gaps.iter().map(text).collect() }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(names: &[&str]) -> Option<Vec<u64>> {
        positions(&names.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn positions_keep_gaps_of_counted_files_only() {
        assert_eq!(found(&["0.pcd", "1.pcd", "2.pcd", "5.pcd"]), Some(vec![0, 1, 2, 5]));
        assert_eq!(found(&["x_10.pcd", "x_20.pcd", "x_30.pcd", "x_60.pcd"]), Some(vec![0, 1, 2, 5]));
        assert_eq!(found(&["103.pcd", "201.pcd", "298.pcd", "405.pcd"]), None, "times in an unknown unit");
        assert_eq!(found(&["a.pcd", "b.pcd"]), None);
        assert_eq!(found(&["01.pcd", "1.pcd", "2.pcd"]), None, "one number twice");
        assert_eq!(found(&["1.pcd", "2.pcd", "20231114.pcd"]), None, "a date");
        assert_eq!(found(&["0.pcd", "1.pcd", "18000000000000000000.pcd"]), None);
    }

    #[test]
    fn missing_files_are_counted_and_the_files_around_them_named() {
        let missing = missing_files(&["d/x.pcap", "d/x.pcap1", "d/x.pcap2", "d/x.pcap5"].map(PathBuf::from));
        let text = "by the numbers in the names, 2 between x.pcap2 (0 bytes) and x.pcap5 (0 bytes)";
        assert_eq!(missing, Missing { n_files: 2, texts: vec![text.to_owned()] });
    }
}
