//! Paths and mode of a run.

use crate::process::own_folder;
use messages::Message;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the manifest in the folder of a drive. The supervisor depends on nothing else in a drive.
pub const DRIVE_MANIFEST: &str = "drive.toml";

/// Paths and mode of a run. Paths are absolute.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Context {
    /// The drive's folder. Live: the manifest with the mounting of the sensors (`run.rig`), or a drive folder with one.
    pub drive: PathBuf,
    /// Folder of the results.
    pub output: PathBuf,
    /// Folder of launch.toml, where relative paths in settings start. See [`Context::resolve`].
    pub launch_folder: PathBuf,
    /// See [`Mode`].
    pub mode: Mode,
    /// Topics that have a producer in this run. An optional input that has been empty so far may still be connected:
    /// check with [`Context::is_connected`].
    pub connected: Vec<String>,
    /// Topics that stages of this run read but that have no producer, because another source replaces the producing
    /// stage (`--source`).
    pub missing: Vec<String>,
}

impl Context {
    /// A path from the settings, made absolute: see [`find_file`].
    pub fn resolve(&self, path: &Path) -> PathBuf {
        find_file(&self.launch_folder, path)
    }
    /// Whether a stage of this run publishes the topic of `T`.
    pub fn is_connected<T: Message>(&self) -> bool {
        self.connected.iter().any(|topic| topic == T::TOPIC)
    }
}

/// The file that a setting names, relative to the folder of the launch file. If it is absent there, the file installed
/// with the programs, in `share/replica` next to their folder: so `models/street.safetensors` is found everywhere.
pub fn find_file(launch_folder: &Path, named: &Path) -> PathBuf {
    find_in(launch_folder, &own_folder(), named)
}

fn find_in(launch_folder: &Path, programs: &Path, named: &Path) -> PathBuf {
    let path = launch_folder.join(named);
    let installed = programs.parent().map(|prefix| prefix.join("share/replica").join(named));
    match installed.filter(|installed| !path.exists() && installed.is_file()) {
        Some(installed) => installed,
        None => path,
    }
}

settings::words! {
    /// Processing mode: lossless, or newest messages first.
    pub enum Mode {
        /// Lossless and deterministic: a fast stage waits for a slow one.
        Offline = "offline",
        /// Bounded latency: the oldest unprocessed message is dropped and counted.
        Live = "live",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_beside_the_launch_file_comes_before_the_installed_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let own = folder.path().join("own");
        let programs = folder.path().join("usr/bin");
        let installed = folder.path().join("usr/share/replica/models");
        std::fs::create_dir_all(&installed).expect("made");
        std::fs::create_dir_all(own.join("models")).expect("made");
        let model = Path::new("models/street.safetensors");
        assert_eq!(find_in(&own, &programs, model), own.join(model), "neither is there: the first is reported");
        std::fs::write(installed.join("street.safetensors"), "installed").expect("written");
        assert_eq!(find_in(&own, &programs, model), installed.join("street.safetensors"));
        std::fs::write(own.join(model), "own").expect("written");
        assert_eq!(find_in(&own, &programs, model), own.join(model));
        let absolute = folder.path().join("absent.safetensors");
        assert_eq!(find_in(&own, &programs, &absolute), absolute);
    }
}
