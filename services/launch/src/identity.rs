//! The files on which the results of a run depend beside the data of its drive: programs, models, rigs, the drive's manifest. A
//! run that continued with another content would be half of one program or model, half of another.

use crate::plan::Plan;
use formats::drive::MANIFEST_FILE;
use run::checksum::Checksum;
use run::find_file;
use run::toml::de::DeValue;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Larger files are identified by length and time of change: a recording of some GB would delay each start by seconds.
const MAX_DIGESTED: u64 = 256 << 20;
/// Bytes that are read at a time.
const PIECE: usize = 256 << 10;
/// Name for the drive's own files among those of the stages.
const DRIVE: &str = "run.drive";

/// The files of a run by stage.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Files(BTreeMap<String, BTreeMap<PathBuf, FileIdentity>>);

/// What identifies the content of a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct FileIdentity {
    digest: String,
    /// When the digest was computed: device, inode, length and times. Only within one run.
    #[serde(skip)]
    seen: Option<[i64; 7]>,
}

/// A file whose content is needed and cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{file}: cannot be read: {source}")]
pub struct UnreadableFile {
    /// The file.
    pub file: PathBuf,
    /// The operating system's error.
    pub source: Error,
}

impl Files {
    /// The files of the plan as they are now. Those that are as in `known` are not read again.
    pub fn of(plan: &Plan, known: &Self) -> Result<Self, UnreadableFile> {
        let mut files = Self::default();
        for stage in &plan.stages {
            let python = PathBuf::from(&stage.table.python);
            let interpreter = (python.is_absolute() && python.is_file()).then_some(&python);
            let paths = std::iter::once(&stage.program).chain(interpreter).chain(&stage.files);
            files.add(&stage.name, paths, known)?;
        }
        let manifest = plan.context.drive.join(MANIFEST_FILE);
        files.add(DRIVE, [&plan.context.drive, &manifest].into_iter().filter(|path| path.is_file()), known)?;
        Ok(files)
    }

    fn add<'a>(
        &mut self,
        stage: &str,
        paths: impl Iterator<Item = &'a PathBuf>,
        known: &Self,
    ) -> Result<(), UnreadableFile> {
        let files = self.0.entry(stage.to_owned()).or_default();
        for path in paths {
            let known = known.0.get(stage).and_then(|known| known.get(path));
            let identity = FileIdentity::of(path, known);
            files.insert(path.clone(), identity.map_err(|source| UnreadableFile { file: path.clone(), source })?);
        }
        Ok(())
    }

    /// The first file whose content differs from `before`, the files of the stage `except` left out.
    pub fn changed_since(&self, before: &Self, except: Option<&str>) -> Option<&Path> {
        let stages = self.0.iter().filter(|(stage, _)| except != Some(stage.as_str()));
        stages.flat_map(|(stage, files)| files.iter().map(move |file| (stage, file))).find_map(
            |(stage, (path, now))| {
                let before = before.0.get(stage)?.get(path);
                before.is_none_or(|before| before.digest != now.digest).then_some(path.as_path())
            },
        )
    }
}

impl FileIdentity {
    fn of(path: &Path, known: Option<&Self>) -> Result<Self, Error> {
        let metadata = std::fs::metadata(path)?;
        let seen = Some(seen(&metadata));
        if let Some(known) = known.filter(|known| known.seen == seen) {
            return Ok(known.clone());
        }
        let by_time = || Self { digest: format!("{} bytes, changed at {}", metadata.len(), metadata.mtime()), seen };
        if metadata.len() > MAX_DIGESTED {
            return Ok(by_time());
        }
        let mut file = match File::open(path) {
            Ok(file) => file,
            // A program may be started and not read.
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
    let (device, inode, len) = (metadata.dev() as i64, metadata.ino() as i64, metadata.len() as i64);
    [device, inode, len, metadata.mtime(), metadata.mtime_nsec(), metadata.ctime(), metadata.ctime_nsec()]
}

/// The files that texts among these values name: see [`find_file`].
pub fn named_files<'a>(values: impl Iterator<Item = &'a DeValue<'a>>, folder: &Path) -> BTreeSet<PathBuf> {
    let mut files = BTreeSet::new();
    let mut left: Vec<&DeValue<'_>> = values.collect();
    while let Some(value) = left.pop() {
        match value {
            DeValue::String(text) if !text.is_empty() => {
                let path = find_file(folder, Path::new(text.as_ref()));
                files.extend(path.is_file().then_some(path));
            }
            DeValue::Array(items) => left.extend(items.iter().map(run::toml::Spanned::get_ref)),
            DeValue::Table(table) => left.extend(table.values().map(run::toml::Spanned::get_ref)),
            _ => {}
        }
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::toml::de::DeTable;

    fn files_of(path: &Path, known: &Files) -> Files {
        let mut files = Files::default();
        files.add("infer", std::iter::once(&path.to_owned()), known).expect("is there");
        files
    }

    #[test]
    fn file_with_another_content_at_the_same_path_is_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("model.safetensors");
        std::fs::write(&path, "one model").expect("written");
        let before = files_of(&path, &Files::default());
        assert_eq!(files_of(&path, &before).changed_since(&before, None), None);
        // As in run/settings.json: without what was seen of the file.
        let text = serde_json::to_string(&before).expect("JSON");
        let stored: Files = serde_json::from_str(&text).expect("JSON");
        assert_eq!(files_of(&path, &stored).changed_since(&stored, None), None);
        std::fs::write(&path, "two model").expect("written");
        for before in [&before, &stored] {
            let now = files_of(&path, before);
            assert_eq!(now.changed_since(before, None), Some(path.as_path()));
            assert_eq!(now.changed_since(before, Some("infer")), None, "this stage is replaced on purpose");
        }
        std::fs::remove_file(&path).expect("removed");
        let error = Files::default().add("infer", std::iter::once(&path), &before).expect_err("is gone").to_string();
        assert!(error.contains("model.safetensors: cannot be read"), "{error}");
    }

    #[test]
    fn texts_that_name_files_are_found_at_any_depth() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["model", "rig.toml", "list"] {
            std::fs::write(folder.path().join(name), "").expect("written");
        }
        let text = "a = 'model'\nb = ['list', 'absent', '']\nc = { d = { rig = 'rig.toml' } }\ne = 3\nf = '.'";
        let table = DeTable::parse(text).expect("TOML").into_inner();
        let found = named_files(table.values().map(run::toml::Spanned::get_ref), folder.path());
        let names = ["list", "model", "rig.toml"].map(|name| folder.path().join(name));
        assert_eq!(found.into_iter().collect::<Vec<_>>(), names);
    }
}
