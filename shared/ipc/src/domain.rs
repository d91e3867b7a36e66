//! One run's own world: its services and memory carry a prefix and lie under a folder that no other run has.

use crate::{Iox, IpcError};
use iceoryx2::prelude::*;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::path::{Path as StdPath, PathBuf};
use std::time::Duration;

/// Where POSIX shared memory lies on Linux.
const SHARED_MEMORY: &str = "/dev/shm";

/// Between the making of a file and its length lie microseconds, on a busy machine some tens of milliseconds.
const LONGEST_MAKING: Duration = Duration::from_secs(1);

/// Attempts to remove a folder in which somebody who looks on is just making a file of its own.
const MAX_REMOVALS: usize = 20;

/// Names a run's services. Two domains never meet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    name: String,
}

impl Domain {
    /// `name`: lower-case letters and digits, at most 32. Runs choose one that says which run it is.
    pub fn new(name: &str) -> Result<Self, IpcError> {
        let fits = (1..=32).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit());
        if fits {
            return Ok(Self { name: name.to_owned() });
        }
        Err(IpcError::transport(format!("domain name {name:?}"), "must be 1 to 32 lower-case letters and digits"))
    }

    /// As given to [`Domain::new`].
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Start of the name of every file of this domain in shared memory.
    pub fn prefix(&self) -> String {
        format!("replica_{}_", self.name)
    }

    /// Folder of iceoryx2's own files. Short, because socket paths have at most 108 bytes; in memory, because iceoryx2 syncs
    /// each of them, and a run has a thousand: on a disk a start took seconds.
    pub fn root(&self) -> PathBuf {
        PathBuf::from(format!("{SHARED_MEMORY}/replica_{}", self.name))
    }

    /// Removes everything of this domain: only when none of its processes lives.
    pub fn wipe(&self) -> Result<(), IpcError> {
        let root = self.root();
        let mut removed = std::fs::remove_dir_all(&root);
        for _ in 1..MAX_REMOVALS {
            if removed.as_ref().is_err_and(|error| error.kind() == std::io::ErrorKind::DirectoryNotEmpty) {
                removed = std::fs::remove_dir_all(&root);
            }
        }
        ignore_absent("removing", &root, removed)?;
        for file in self.files()? {
            ignore_absent("removing", &file, std::fs::remove_file(&file))?;
        }
        Ok(())
    }

    /// Files of this domain in shared memory.
    fn files(&self) -> Result<Vec<PathBuf>, IpcError> {
        let prefix = self.prefix();
        let io = |cause| IpcError::Io { what: format!("listing {SHARED_MEMORY}"), cause };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(SHARED_MEMORY).map_err(io)? {
            let entry = entry.map_err(io)?;
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                files.push(entry.path());
            }
        }
        Ok(files)
    }

    /// Whether a file in shared memory has no length yet. Who opens such a file waits for its length, without end if its maker
    /// was killed between the two calls (iceoryx2 0.10): those that nobody can be making any more are removed. One whose maker is killed
    /// after this look and before it is used stays a danger.
    fn has_unfinished_files(&self) -> Result<bool, IpcError> {
        let mut unfinished = false;
        for file in self.files()? {
            // What is gone by now is not in the way.
            let Ok(metadata) = std::fs::metadata(&file) else { continue };
            if !metadata.is_file() || metadata.len() > 0 {
                continue;
            }
            // A clock that was set back tells no age.
            let age = metadata.modified().ok().and_then(|made| made.elapsed().ok()).unwrap_or(LONGEST_MAKING);
            if age < LONGEST_MAKING {
                unfinished = true;
            } else {
                ignore_absent("removing", &file, std::fs::remove_file(&file))?;
            }
        }
        Ok(unfinished)
    }

    /// iceoryx2 makes its node counter readable and writable by everybody; a run is its owner's alone.
    fn close_to_others(&self) -> Result<(), IpcError> {
        for file in self.files()?.iter().filter(|file| file.extension().is_some_and(|e| e == "global_mgmt")) {
            // The file of a node that has just left is gone: nothing to close.
            let closed = std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o600));
            ignore_absent("closing", file, closed)?;
        }
        Ok(())
    }

    /// Bytes of shared memory that the domain really uses.
    pub fn used_bytes(&self) -> u64 {
        use std::os::unix::fs::MetadataExt;
        let files = self.files().unwrap_or_default();
        // st_blocks counts units of 512 bytes whatever the file system's block size.
        files.iter().filter_map(|file| std::fs::metadata(file).ok()).map(|metadata| metadata.blocks() * 512).sum()
    }

    /// A participant of the domain. Its ports belong to the calling thread.
    pub fn node(&self, name: &str) -> Result<Node, IpcError> {
        // Problems come back as errors; iceoryx2's own log, by IOX2_LOG_LEVEL, is for those who look into the transport.
        set_log_level_from_env_or(LogLevel::Fatal);
        let root = self.root();
        std::fs::DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(&root)
            .map_err(|cause| IpcError::Io { what: format!("creating {}", root.display()), cause })?;
        let owner_alone = std::fs::metadata(&root).is_ok_and(|m| m.permissions().mode() & 0o077 == 0);
        if !owner_alone {
            return Err(IpcError::transport(root.display().to_string(), "is open to other users"));
        }
        let what = || format!("node {name} of domain {}", self.name);
        let mut config = Config::default();
        config.global.prefix = self.prefix().as_str().try_into().map_err(|cause| IpcError::transport(what(), cause))?;
        let root: Path =
            root.to_string_lossy().as_ref().try_into().map_err(|cause| IpcError::transport(what(), cause))?;
        config.global.set_root_path(&root);
        // Cleaning up after the dead is the supervisor's task: it wipes the whole domain.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let node_name: NodeName = name.try_into().map_err(|cause| IpcError::transport(what(), cause))?;
        let node = NodeBuilder::new()
            .name(&node_name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Iox>()
            .map_err(|cause| IpcError::transport(what(), cause))?;
        self.close_to_others()?;
        Ok(Node(node, self.clone()))
    }
}

fn ignore_absent(what: &str, path: &StdPath, result: std::io::Result<()>) -> Result<(), IpcError> {
    match result {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(IpcError::Io { what: format!("{what} {}", path.display()), cause })
        }
        _ => Ok(()),
    }
}

/// A participant of a domain: makes ports.
pub struct Node(pub(crate) iceoryx2::prelude::Node<Iox>, pub(crate) Domain);

impl Node {
    /// Removes the ports of processes that have died, so that nobody waits for what they would have taken. `false`: not yet,
    /// because somebody is just making a port or has died while he did, or because shared memory cannot be looked at.
    pub fn forget_dead(&self) -> bool {
        if self.1.has_unfinished_files().unwrap_or(true) {
            return false;
        }
        // What another process is cleaning up already, or cannot be cleaned yet, is left to the next call.
        let _state = self.0.try_cleanup_dead_nodes();
        true
    }
}

/// iceoryx2's form of a service name.
pub(crate) fn service_name(name: &str) -> Result<ServiceName, IpcError> {
    name.try_into().map_err(|cause| IpcError::transport(format!("service name {name:?}"), cause))
}
