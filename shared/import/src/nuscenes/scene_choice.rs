//! Choice of the scenes to import.

use super::table::rows;
use crate::Options;
use crate::error::ImportError;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Maximum number of scenes that an error names.
const MAX_NAMED: usize = 8;

/// Scenes of one version of the data set.
pub(super) struct SceneChoice {
    /// Folder of the tables.
    pub tables: PathBuf,
    /// Tokens of the scenes.
    pub scenes: BTreeSet<String>,
    /// Name of the drive.
    pub name: String,
}

#[derive(Deserialize)]
struct Scene {
    token: String,
    name: String,
    log_token: String,
}

#[derive(Deserialize)]
struct Log {
    token: String,
    logfile: String,
}

impl SceneChoice {
    /// The scene of `--scene`, all scenes of `--log`, or the only scene.
    pub fn new(source: &Path, versions: &[PathBuf], options: &Options) -> Result<Self, ImportError> {
        let mut all = BTreeSet::new();
        for tables in versions {
            let scenes: Vec<Scene> = rows(&tables.join("scene.json"))?;
            let logs: Vec<Log> = rows(&tables.join("log.json"))?;
            let files: BTreeMap<&str, &str> =
                logs.iter().map(|log| (log.token.as_str(), log.logfile.as_str())).collect();
            let is_chosen = |scene: &&Scene| match (&options.scene, &options.log) {
                (Some(name), _) => scene.name == *name,
                (None, Some(log)) => files.get(scene.log_token.as_str()) == Some(&log.as_str()),
                (None, None) => versions.len() == 1 && scenes.len() == 1,
            };
            let chosen: Vec<&Scene> = scenes.iter().filter(is_chosen).collect();
            if let Some(first) = chosen.first() {
                let name = options.log.as_ref().filter(|_| options.scene.is_none()).unwrap_or(&first.name).clone();
                let scenes = chosen.iter().map(|scene| scene.token.clone()).collect();
                return Ok(Self { tables: tables.clone(), scenes, name });
            }
            all.extend(scenes.into_iter().map(|scene| scene.name));
        }
        let names = all.iter().take(MAX_NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
        let more = if all.len() > MAX_NAMED { ", ..." } else { "" };
        let (option, wanted) = match (&options.scene, &options.log) {
            (Some(name), _) => ("--scene", format!("no scene {name}")),
            (None, Some(log)) => ("--log", format!("no scene of log {log}")),
            (None, None) => {
                let rule = format!(
                    "{} scenes; choose one with --scene, or all of a drive with --log: {names}{more}",
                    all.len()
                );
                return Err(ImportError::at(source, rule));
            }
        };
        Err(ImportError::for_option(option, format!("{wanted} in {}; it has {names}{more}", source.display())))
    }
}
