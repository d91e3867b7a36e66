//! Files on whose content the results of a stage depend, such as its model: the files that its settings name, and their
//! digests.

use crate::checksum::Checksum;
use crate::launch_file::LaunchFile;
use crate::{SUPERVISOR_KEYS, find_file};
use files::regular_file;
use serde::{Deserialize, Serialize};
use settings::Field;
use std::collections::BTreeSet;
use std::fs::Metadata;
use std::io::{Error, ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use toml::de::DeValue;

/// Largest file with a digest. Larger files are identified by length and time of change: a digest of a recording of
/// some GB would delay each start by seconds.
const MAX_DIGESTED: u64 = 256 << 20;
/// Bytes that are read at a time.
const PIECE: usize = 256 << 10;
/// Identifies the content of a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FileIdentity {
    digest: String,
    /// State of the file when the digest was computed: device, inode, length and times. Only within one run.
    #[serde(skip)]
    seen: Option<[i64; 7]>,
}

impl FileIdentity {
    /// The identity of a file on another host.
    pub fn from_digest(digest: &str) -> Self {
        Self { digest: digest.to_owned(), seen: None }
    }

    /// A checksum of the content; for a large file, its length and time of change.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// The identity of a file now. The file is not read if it has not changed since `known` was computed.
    pub fn read(path: &Path, known: Option<&Self>) -> Result<Self, Error> {
        let metadata = std::fs::metadata(path)?;
        let seen = Some(seen(&metadata));
        if let Some(known) = known.filter(|known| known.seen == seen) {
            return Ok(known.clone());
        }
        let by_time = || Self { digest: format!("{} bytes, changed at {}", metadata.len(), metadata.mtime()), seen };
        if metadata.len() > MAX_DIGESTED {
            return Ok(by_time());
        }
        let mut file = match regular_file::open(path) {
            Ok(file) => file,
            // A program may be executable but not readable.
            Err(error) if error.kind() == ErrorKind::PermissionDenied => return Ok(by_time()),
            Err(error) => return Err(error),
        };
        let mut sum = Checksum::new();
        let mut piece = vec![0; PIECE];
        loop {
            match file.read(&mut piece)? {
                0 => break,
                n => sum.add(&piece[..n]),
            }
        }
        Ok(Self { digest: format!("{:016x}", sum.sum()), seen })
    }
}

fn seen(metadata: &Metadata) -> [i64; 7] {
    let device = metadata.dev() as i64;
    let inode = metadata.ino() as i64;
    let len = metadata.len() as i64;
    [device, inode, len, metadata.mtime(), metadata.mtime_nsec(), metadata.ctime(), metadata.ctime_nsec()]
}

/// The files named by the texts among these values: see [`find_file`].
fn named_files<'a>(values: impl Iterator<Item = &'a DeValue<'a>>, folder: &Path) -> BTreeSet<PathBuf> {
    let mut files = BTreeSet::new();
    let mut left: Vec<&DeValue<'_>> = values.collect();
    while let Some(value) = left.pop() {
        match value {
            DeValue::String(text) if !text.is_empty() => {
                let path = find_file(folder, Path::new(text.as_ref()));
                files.extend(path.is_file().then_some(path));
            }
            DeValue::Array(items) => left.extend(items.iter().map(toml::Spanned::get_ref)),
            DeValue::Table(table) => left.extend(table.values().map(toml::Spanned::get_ref)),
            _ => {}
        }
    }
    files
}

/// The files that the settings of a stage name: values of its table, and defaults of the settings that the table omits.
pub fn files_of_settings(file: &LaunchFile, table: &str, settings: &[Field], folder: &Path) -> BTreeSet<PathBuf> {
    let table = file.table(table).unwrap_or_default();
    let is_set = |key: &str| table.keys().any(|set| set.get_ref() == key);
    let defaults = settings.iter().filter(|field| !is_set(&field.key));
    // Defaults are written as JSON. A default that is not valid JSON names no file.
    let defaults: Vec<DeValue<'_>> = defaults
        .filter_map(|field| serde_json::from_str::<String>(&field.default).ok())
        .map(|text| DeValue::String(text.into()))
        .collect();
    let set = table.iter().filter(|(key, _)| !SUPERVISOR_KEYS.contains(&key.get_ref().as_ref()));
    named_files(set.map(|(_, value)| value.get_ref()).chain(&defaults), folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml::de::DeTable;

    #[test]
    fn texts_that_name_files_are_found_at_any_depth() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["model", "rig.toml", "list"] {
            std::fs::write(folder.path().join(name), "").expect("written");
        }
        let text = "a = 'model'\nb = ['list', 'absent', '']\nc = { d = { rig = 'rig.toml' } }\ne = 3\nf = '.'";
        let table = DeTable::parse(text).expect("TOML").into_inner();
        let found = named_files(table.values().map(toml::Spanned::get_ref), folder.path());
        let names = ["list", "model", "rig.toml"].map(|name| folder.path().join(name));
        assert_eq!(found.into_iter().collect::<Vec<_>>(), names);
    }
}
