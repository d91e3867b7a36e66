//! The drives of the command line: their names and outputs, and which of them belong to a job of an array.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A drive of the batch.
#[derive(Debug)]
pub struct BatchDrive {
    /// Name of its folder, or of its capture without extension.
    pub name: String,
    /// Absolute, without links.
    pub path: PathBuf,
    /// Folder of its results.
    pub output: PathBuf,
    /// Messages of its run.
    pub log: PathBuf,
}

impl BatchDrive {
    /// The drives at these paths with their outputs in `out`, or all faults of the list.
    pub fn list(paths: &[PathBuf], out: &Path) -> Result<Vec<Self>, Vec<String>> {
        let mut drives = Vec::new();
        let mut faults = Vec::new();
        let mut owners: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
        let out = without_links(out);
        for path in paths {
            let drive = match Self::new(path, &out) {
                Ok(drive) => drive,
                Err(fault) => {
                    faults.push(format!("{}: {fault}", path.display()));
                    continue;
                }
            };
            if drive.output == drive.path {
                let text = "its results would go into the drive itself; set another --out";
                faults.push(format!("{}: {text}", path.display()));
            }
            for file in [&drive.output, &drive.log] {
                let Some(owner) = owners.insert(file.clone(), drive.path.clone()) else { continue };
                faults.push(if owner == drive.path {
                    format!("{}: is given twice", path.display())
                } else {
                    format!("{} and {} would both write {}", owner.display(), drive.path.display(), file.display())
                });
                break;
            }
            drives.push(drive);
        }
        if faults.is_empty() { Ok(drives) } else { Err(faults) }
    }

    fn new(path: &Path, out: &Path) -> Result<Self, String> {
        let path = path.canonicalize().map_err(|error| error.to_string())?;
        let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
        let name = name.ok_or("has no name")?;
        let is_text = path.to_str().is_some();
        let name = name.to_str().filter(|_| is_text).ok_or("the path is not UTF-8; rename the drive")?.to_owned();
        Ok(Self { output: out.join(&name), log: out.join(format!("{name}.log")), name, path })
    }
}

/// The absolute path without links, whether or not the folder exists: the path of an output is part of what identifies its run.
fn without_links(folder: &Path) -> PathBuf {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let resolved = absolute.ancestors().find_map(|ancestor| {
        let rest = absolute.strip_prefix(ancestor).ok()?;
        Some(ancestor.canonicalize().ok()?.join(rest))
    });
    resolved.unwrap_or(absolute)
}

/// `I/N`: job I of an array of N.
///
/// Drive k of the command line, counted from 0, belongs to job k mod N + 1. The rule reads nothing but the command line, so all
/// jobs agree on it, whenever they start and whatever the shared folder contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Index of the job, from 0.
    index: usize,
    n_jobs: usize,
}

/// A job that is not in its array.
#[derive(Debug, thiserror::Error)]
#[error("must be I/N with 1 <= I <= N")]
pub struct InvalidJob;

impl Job {
    /// All jobs of an array.
    pub fn all(n_jobs: usize) -> impl Iterator<Item = Self> {
        (0..n_jobs).map(move |index| Self { index, n_jobs })
    }

    /// Whether the drive with this index, from 0, belongs to the job.
    pub fn has(self, drive: usize) -> bool {
        drive % self.n_jobs == self.index
    }
}

impl FromStr for Job {
    type Err = InvalidJob;

    fn from_str(text: &str) -> Result<Self, InvalidJob> {
        let (number, n_jobs) = text.split_once('/').ok_or(InvalidJob)?;
        let [number, n_jobs] = [number, n_jobs].map(|text| text.parse::<usize>().ok());
        match (number, n_jobs) {
            (Some(number), Some(n_jobs)) if (1..=n_jobs).contains(&number) => Ok(Self { index: number - 1, n_jobs }),
            _ => Err(InvalidJob),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_drive_belongs_to_exactly_one_job() {
        for n_jobs in 1..9 {
            for drive in 0..20 {
                assert_eq!(Job::all(n_jobs).filter(|job| job.has(drive)).count(), 1, "drive {drive} of {n_jobs} jobs");
            }
        }
        let third: Job = "3/4".parse().expect("a job");
        assert_eq!((0..12).filter(|drive| third.has(*drive)).collect::<Vec<_>>(), [2, 6, 10]);
    }

    #[test]
    fn job_outside_its_array_is_refused() {
        for text in ["0/4", "5/4", "1/0", "4", "1/2/3", "-1/4", "a/b", ""] {
            assert!(text.parse::<Job>().is_err(), "{text}");
        }
    }

    #[test]
    fn output_has_one_path_before_and_after_the_first_batch() {
        let folder = tempfile::tempdir().expect("a folder");
        let real = folder.path().join("real");
        let link = folder.path().join("link");
        std::fs::create_dir(&real).expect("made");
        std::os::unix::fs::symlink(&real, &link).expect("linked");
        let out = link.join("a/b");
        let before = without_links(&out);
        std::fs::create_dir_all(&out).expect("made");
        assert_eq!(without_links(&out), before);
        assert!(before.ends_with("real/a/b"), "{}", before.display());
    }

    #[test]
    fn all_faults_of_a_list_are_reported_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["a/monday", "b/monday", "c/friday", "c/friday.log"] {
            std::fs::create_dir_all(path(name)).expect("made");
        }
        std::fs::write(path("tuesday.pcap"), "").expect("written");
        let names = ["a/monday", "b/monday", "absent", "tuesday.pcap", "b/../tuesday.pcap", "c/friday", "c/friday.log"];
        let given: Vec<PathBuf> = names.iter().map(|name| path(name)).collect();
        let faults = BatchDrive::list(&given, &path("out")).expect_err("is refused");
        let rules = ["b/monday would both write", "absent: No such file", "tuesday.pcap: is given twice"];
        for rule in rules.iter().chain(&["friday.log would both write"]) {
            assert!(faults.iter().any(|fault| fault.contains(rule)), "{rule}: {faults:#?}");
        }
        assert_eq!(faults.len(), 4, "{faults:#?}");
        let into_itself = BatchDrive::list(&given[..1], &path("a")).expect_err("is refused");
        assert!(into_itself[0].contains("into the drive itself"), "{into_itself:?}");
        let drives = BatchDrive::list(&[given[0].clone(), given[3].clone()], &path("out")).expect("sound");
        assert_eq!(drives.iter().map(|drive| drive.name.as_str()).collect::<Vec<_>>(), ["monday", "tuesday"]);
        assert!(drives[1].log.ends_with("out/tuesday.log"));
    }
}
