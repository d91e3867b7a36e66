//! Files named by the line numbers of a file of stamps.

use crate::error::{At, ImportError};
use crate::files::{files, stem};
use files::text_file::read_long_text;
use std::path::{Path, PathBuf};

/// The stamps of a sensor: one per line.
pub(crate) struct Stamps {
    path: PathBuf,
    /// Number of the line, from 1, and stamp, ns.
    lines: Vec<(usize, i64)>,
}

/// A file of a sensor.
pub(crate) struct StampedFile {
    /// The number in the file name.
    pub number: usize,
    /// ns since the Unix epoch.
    pub stamp: i64,
    pub name: String,
    /// Absolute path.
    pub path: PathBuf,
}

impl Stamps {
    /// Reads one stamp per line.
    pub fn read(path: &Path, nanos: fn(&str) -> Option<i64>) -> Result<Self, ImportError> {
        let text = read_long_text(path).at(path)?;
        let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
        let stamp = |(number, line): (usize, &str)| match nanos(line.trim()) {
            Some(nanos) => Ok((number, nanos)),
            None => Err(ImportError::at_line(path, number, format!("{line:?} is not a valid time"))),
        };
        Ok(Self { path: path.to_owned(), lines: lines.map(stamp).collect::<Result<_, _>>()? })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// The stamp of a file with a number.
    pub fn by_number(&self, number: usize, path: &Path) -> Result<i64, ImportError> {
        let line = self.lines.get(number).map(|(_, stamp)| *stamp);
        line.ok_or_else(|| {
            let n = self.lines.len();
            let times = self.path.display();
            ImportError::at(path, format!("has number {number}, but {times} has {n} stamps, for the numbers from 0 on"))
        })
    }

    /// The files of a folder with this ending, sorted by number.
    pub fn records(&self, folder: &Path, end: &str) -> Result<Vec<StampedFile>, ImportError> {
        let mut found = Vec::new();
        for (name, path) in files(folder, end)? {
            let number = number_of(&name, end, &path)?;
            found.push(StampedFile { number, stamp: self.by_number(number, &path)?, name, path });
        }
        found.sort_by_key(|file| file.number);
        Ok(found)
    }

    /// The files of a folder, as [`Stamps::records`], whose stamps must increase.
    pub fn files(&self, folder: &Path, end: &str) -> Result<Vec<StampedFile>, ImportError> {
        let found = self.records(folder, end)?;
        for pair in found.windows(2) {
            if pair[0].stamp >= pair[1].stamp {
                let line = self.lines[pair[1].number].0;
                let rule = format!("the stamp must be later than the stamp of {}, the previous file", pair[0].name);
                return Err(ImportError::at_line(&self.path, line, rule));
            }
        }
        Ok(found)
    }
}

/// The number that forms the name of a file.
pub(crate) fn number_of(name: &str, end: &str, path: &Path) -> Result<usize, ImportError> {
    let number = stem(name, end).and_then(|stem| stem.parse().ok());
    number.ok_or_else(|| ImportError::at(path, format!("name must be a number and {end}")))
}
