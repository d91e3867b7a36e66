//! How long a batch takes as an array of jobs: the rule of `--job`, with the times of the drives that are finished. A drive
//! that is not finished costs in proportion to its bytes.

use super::drives::{BatchDrive, Job};
use super::results::Row;
use anyhow::bail;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// What a drive costs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cost {
    seconds: f64,
    read_bytes: f64,
    kept_bytes: f64,
}

impl Cost {
    fn plus(self, other: Self) -> Self {
        Self {
            seconds: self.seconds + other.seconds,
            read_bytes: self.read_bytes + other.read_bytes,
            kept_bytes: self.kept_bytes + other.kept_bytes,
        }
    }

    /// The cost of a drive with these bytes, in proportion.
    fn scaled_to(self, read_bytes: f64) -> Self {
        let share = read_bytes / self.read_bytes;
        Self { seconds: self.seconds * share, read_bytes, kept_bytes: self.kept_bytes * share }
    }
}

/// What all drives cost.
struct Expected {
    costs: Vec<Cost>,
    n_measured: usize,
    /// Sum of the measured drives.
    sum: Cost,
}

impl Expected {
    /// `None`: no drive is finished.
    fn new(drives: &[BatchDrive]) -> Option<Self> {
        let costs: Vec<(f64, Option<Cost>)> =
            drives.iter().map(|drive| (bytes_of(&drive.path), measured(drive))).collect();
        let known: Vec<Cost> = costs.iter().filter_map(|(_, cost)| *cost).collect();
        let sum = known.iter().fold(Cost::default(), |sum, cost| sum.plus(*cost));
        if sum.seconds <= 0.0 || sum.read_bytes <= 0.0 {
            return None;
        }
        let costs = costs.iter().map(|(bytes, cost)| cost.unwrap_or(sum.scaled_to(*bytes))).collect();
        Some(Self { costs, n_measured: known.len(), sum })
    }
}

/// Seconds that each drive takes or took. `None`: no drive is finished.
pub fn expected_seconds(drives: &[BatchDrive]) -> Option<Vec<f64>> {
    Expected::new(drives).map(|expected| expected.costs.iter().map(|cost| cost.seconds).collect())
}

/// The table for 1 to `n_machines` machines.
pub fn text(drives: &[BatchDrive], n_machines: usize) -> anyhow::Result<String> {
    let Some(Expected { costs, n_measured, sum }) = Expected::new(drives) else {
        bail!(
            "no drive is finished: the plan needs the time of at least one\nhint: run the batch with one drive first"
        );
    };
    let mut text = format!(
        "{} drives, {} of them measured: {:.1} MB/s read, {:.2} bytes of results for each byte of a drive\n\
         machines   seconds  efficiency  GB read  GB of results (of the machine with the most)\n",
        drives.len(),
        n_measured,
        sum.read_bytes / sum.seconds * 1e-6,
        sum.kept_bytes / sum.read_bytes
    );
    let all_seconds: f64 = costs.iter().map(|cost| cost.seconds).sum();
    for n in machine_counts(n_machines) {
        let jobs = jobs(&costs, n);
        let most = |of: fn(&Cost) -> f64| jobs.iter().map(of).fold(0.0, f64::max);
        let makespan_s = most(|job| job.seconds);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{n:8}  {makespan_s:8.1}  {:8.0} %  {:7.2}  {:13.2}",
            all_seconds / (makespan_s * n as f64) * 100.0,
            most(|job| job.read_bytes) * 1e-9,
            most(|job| job.kept_bytes) * 1e-9
        );
    }
    Ok(text)
}

/// What the drive cost, if its run has finished.
fn measured(drive: &BatchDrive) -> Option<Cost> {
    let row = Row::read(drive);
    row.is_finished().then(|| Cost {
        seconds: row.wall_s,
        read_bytes: bytes_of(&drive.path),
        kept_bytes: bytes_of(&drive.output),
    })
}

/// What each job costs.
fn jobs(costs: &[Cost], n_jobs: usize) -> Vec<Cost> {
    let of = |job: Job| {
        let own = costs.iter().enumerate().filter(move |(drive, _)| job.has(*drive));
        own.fold(Cost::default(), |sum, (_, cost)| sum.plus(*cost))
    };
    Job::all(n_jobs).map(of).collect()
}

/// Numbers of machines: 1, 2, 5, 10, 20, 50 ... and the last.
fn machine_counts(last: usize) -> Vec<usize> {
    let decades = std::iter::successors(Some(1_usize), |decade| decade.checked_mul(10));
    let mut counts: Vec<usize> = decades
        .flat_map(|decade| [1, 2, 5].map(|digit| decade.saturating_mul(digit)))
        .take_while(|n| *n < last)
        .collect();
    counts.push(last);
    counts
}

/// Bytes of a file, or of all files in a folder. Links are followed: imported drives consist of links to their recordings. A file
/// with several names counts once; unreadable files count as zero.
fn bytes_of(path: &Path) -> f64 {
    let mut left = vec![path.to_owned()];
    let mut counted = BTreeSet::new();
    let mut bytes = 0_u64;
    while let Some(path) = left.pop() {
        let Ok(metadata) = std::fs::metadata(&path) else { continue };
        // Also ends the walk through a folder with a link to itself.
        if !counted.insert((metadata.dev(), metadata.ino())) {
            continue;
        }
        if metadata.is_dir() {
            left.extend(std::fs::read_dir(&path).into_iter().flatten().flatten().map(|entry| entry.path()));
        } else {
            bytes += metadata.len();
        }
    }
    bytes as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn makespan_is_that_of_the_longest_job() {
        let costs = [5.0, 1.0, 2.0, 1.0].map(|seconds| Cost { seconds, ..Cost::default() });
        let seconds = |n| jobs(&costs, n).iter().map(|job| job.seconds).collect::<Vec<_>>();
        assert_eq!(seconds(1), [9.0]);
        assert_eq!(seconds(2), [7.0, 2.0]);
        assert_eq!(seconds(5), [5.0, 1.0, 2.0, 1.0, 0.0]);
    }

    #[test]
    fn links_are_followed_and_files_count_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["recorded/b", "drive/a"] {
            std::fs::create_dir_all(path(name)).expect("made");
        }
        std::fs::write(path("recorded/scan"), vec![0; 1000]).expect("written");
        std::fs::write(path("recorded/b/fixes"), vec![0; 200]).expect("written");
        let link = |target: &str, name: &str| std::os::unix::fs::symlink(path(target), path(name)).expect("linked");
        link("recorded/scan", "drive/scan");
        link("recorded/scan", "drive/a/again");
        link("recorded/b", "drive/b");
        link("drive", "drive/a/loop");
        link("absent", "drive/broken");
        assert_eq!(bytes_of(&path("drive")), 1200.0);
    }

    #[test]
    fn machine_counts_end_with_the_last() {
        assert_eq!(machine_counts(1), [1]);
        assert_eq!(machine_counts(100), [1, 2, 5, 10, 20, 50, 100]);
        assert_eq!(machine_counts(7), [1, 2, 5, 7]);
    }
}
