//! Sweeps stored as one file each.

use crate::Kind;
use crate::error::ImportError;
use crate::plan::{Link, Plan, TextFile};
use drive::TIMES_FILE;
use drive::manifest::{LidarEntry, Manifest};
use std::path::{Path, PathBuf};

/// Folder of the sweeps in the drive.
pub(crate) const LIDAR_FOLDER: &str = "lidar";

/// The sweeps of a source.
#[derive(Debug)]
pub(crate) struct Sweeps {
    /// Name in the drive, and file of each sweep, in the order of their times.
    pub files: Vec<(String, PathBuf)>,
    /// ns since the Unix epoch. `None`: ten sweeps per second.
    pub times: Option<Vec<i64>>,
}

impl Sweeps {
    /// Fails unless there are sweeps, and as many times as sweeps if there are times.
    pub fn check(&self, source: &Path) -> Result<(), ImportError> {
        let n_sweeps = self.files.len();
        if n_sweeps == 0 {
            return Err(ImportError::at(source, "has no sweeps"));
        }
        match &self.times {
            Some(times) if times.len() != n_sweeps => {
                Err(ImportError::at(source, format!("{n_sweeps} sweeps, but {} times", times.len())))
            }
            _ => Ok(()),
        }
    }

    /// A drive with only these sweeps.
    pub fn plan(&self, kind: Kind, name: &str, lidar: LidarEntry) -> Plan {
        Plan {
            kind,
            manifest: Manifest::with_lidar(name, lidar),
            links: self.links(),
            texts: self.times_file().into_iter().collect(),
            conversions: Vec::new(),
            read: Vec::new(),
            report: vec![self.report()],
        }
    }

    /// Links of the drive.
    fn links(&self) -> Vec<Link> {
        let link = |(name, path): &(String, PathBuf)| Link {
            place: Path::new(LIDAR_FOLDER).join(name),
            original: path.clone(),
        };
        self.files.iter().map(link).collect()
    }

    /// The file of the times.
    fn times_file(&self) -> Option<TextFile> {
        let lines: Vec<String> = self.times.as_ref()?.iter().map(i64::to_string).collect();
        Some(TextFile { place: Path::new(LIDAR_FOLDER).join(TIMES_FILE), text: lines.join("\n") + "\n" })
    }

    /// Line of the report.
    fn report(&self) -> String {
        let n_sweeps = self.files.len();
        match &self.times {
            Some(_) => format!("imported: {n_sweeps} sweeps and their times"),
            None => format!("imported: {n_sweeps} sweeps; they have no times: 10 sweeps per second are assumed"),
        }
    }
}
