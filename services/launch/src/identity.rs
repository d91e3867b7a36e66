//! The files on which the results of a run depend in addition to the data of its drive: programs, models, rigs, the
//! drive's manifest. A run continued with another content would mix results of two programs or models.

use crate::plan::Plan;
use run::{DRIVE_MANIFEST, FileIdentity, Remote};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Error;
use std::path::{Path, PathBuf};

/// Name for the drive's own files, which stands among the names of stages.
const DRIVE: &str = "run.drive";

/// The files of a run by stage.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Files(BTreeMap<String, BTreeMap<PathBuf, FileIdentity>>);

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
    /// The current files of the plan. Files unchanged since `known` are not read again.
    pub fn read(plan: &Plan, known: &Self) -> Result<Self, UnreadableFile> {
        let mut files = Self::default();
        for stage in &plan.stages {
            let python = PathBuf::from(&stage.table.python);
            let interpreter = (python.is_absolute() && python.is_file()).then_some(&python);
            let paths = std::iter::once(&stage.program).chain(interpreter).chain(&stage.files);
            files.add(&stage.name, paths, known)?;
            if let Some(remote) = &stage.remote {
                files.add_remote(&stage.name, remote);
            }
        }
        let manifest = plan.context.drive.join(DRIVE_MANIFEST);
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
            let identity = FileIdentity::read(path, known);
            files.insert(path.clone(), identity.map_err(|source| UnreadableFile { file: path.clone(), source })?);
        }
        Ok(())
    }

    /// Adds files of another host with the digests from its description.
    fn add_remote(&mut self, stage: &str, remote: &Remote) {
        let files = self.0.entry(stage.to_owned()).or_default();
        for (file, digest) in &remote.files {
            files.insert(format!("{}:{file}", remote.host).into(), FileIdentity::from_digest(digest));
        }
    }

    /// The first file whose content differs from `before`, the files of the stage `except` left out.
    pub fn changed_since(&self, before: &Self, except: Option<&str>) -> Option<&Path> {
        let stages = self.0.iter().filter(|(stage, _)| except != Some(stage.as_str()));
        stages.flat_map(|(stage, files)| files.iter().map(move |file| (stage, file))).find_map(
            |(stage, (path, now))| {
                let before = before.0.get(stage)?.get(path);
                before.is_none_or(|before| before.digest() != now.digest()).then_some(path.as_path())
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files_of(path: &Path, known: &Files) -> Files {
        let mut files = Files::default();
        files.add("infer", std::iter::once(&path.to_owned()), known).expect("exists");
        files
    }

    #[test]
    fn file_with_another_content_at_the_same_path_is_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("model.safetensors");
        std::fs::write(&path, "one model").expect("written");
        let before = files_of(&path, &Files::default());
        assert_eq!(files_of(&path, &before).changed_since(&before, None), None);
        // The identity as in run/settings.json: without the observed state of the file.
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
        let error = Files::default().add("infer", std::iter::once(&path), &before).expect_err("is absent").to_string();
        assert!(error.contains("model.safetensors: cannot be read"), "{error}");
    }
}
