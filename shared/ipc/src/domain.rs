//! The domain of one run: its services and its memory have a prefix and a folder that no other run uses.

use crate::IpcError;
use crate::ownership::{self, check_private_folder, is_foreign, is_own};
use iceoryx2::prelude::ServiceName;
use std::fs::Metadata;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Folder of POSIX shared memory on Linux.
const SHARED_MEMORY: &str = "/dev/shm";

/// Longest time until a new file has its length: microseconds, on a busy machine some tens of milliseconds.
const MAX_CREATION: Duration = Duration::from_secs(1);

/// File in the folder of a domain: the output of its run.
const OUTPUT: &str = "output";

/// Largest number of attempts to remove a folder in which an observer may be creating a file.
const MAX_REMOVALS: usize = 20;

/// The name of a run's services. Two domains never share a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    name: String,
}

impl Domain {
    /// A domain named `name`: 1 to 32 lower-case letters and digits. Every run has its own.
    pub fn new(name: &str) -> Result<Self, IpcError> {
        let fits = (1..=32).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit());
        if fits {
            return Ok(Self { name: name.to_owned() });
        }
        Err(IpcError::transport(format!("domain name {name:?}"), "must be 1 to 32 lower-case letters and digits"))
    }

    /// The name given to [`Domain::new`].
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

    /// A domain with an unpredictable name.
    pub fn random() -> Result<Self, IpcError> {
        const SOURCE: &str = "/dev/urandom";
        let mut bytes = [0; 8];
        let read = std::fs::File::open(SOURCE).and_then(|mut file| std::io::Read::read_exact(&mut file, &mut bytes));
        read.map_err(|cause| IpcError::Io { what: format!("reading {SOURCE}"), cause })?;
        Self::new(&format!("{:016x}", u64::from_le_bytes(bytes)))
    }

    /// Whether another user has files of this domain's name: then a run cannot use it.
    pub fn is_taken(&self) -> Result<bool, IpcError> {
        Ok(is_foreign(&self.root()) || self.entries()?.iter().any(|file| is_foreign(file)))
    }

    /// Writes the output of the domain's run to a file, for [`Domain::find_abandoned`]. The domain must have a node.
    pub fn write_output(&self, output: &Path) -> Result<(), IpcError> {
        let path = self.root().join(OUTPUT);
        let written = std::fs::write(&path, output.as_os_str().as_bytes());
        written.map_err(|cause| IpcError::Io { what: format!("writing {}", path.display()), cause })
    }

    /// The domains of this user that killed runs into `output` have left.
    pub fn find_abandoned(output: &Path) -> Result<Vec<Self>, IpcError> {
        let folders = listed("replica_")?.into_iter().filter(|path| check_private_folder(path).is_ok());
        let of_output = folders.filter(|path| {
            std::fs::read(path.join(OUTPUT)).is_ok_and(|written| written == output.as_os_str().as_bytes())
        });
        let name = |path: PathBuf| Some(path.file_name()?.to_str()?.strip_prefix("replica_")?.to_owned());
        Ok(of_output.filter_map(name).filter_map(|name| Self::new(&name).ok()).collect())
    }

    /// The domains with files of this user in shared memory, of running and of killed runs, by name; with the output of
    /// the run if it is known.
    pub fn all_own() -> Result<Vec<(Self, Option<PathBuf>)>, IpcError> {
        let own = listed("replica_")?.into_iter().filter(|path| !is_foreign(path));
        let name = |path: PathBuf| {
            let name = path.file_name()?.to_str()?.strip_prefix("replica_")?;
            // `replica_<name>`, or a file `replica_<name>_<rest>`.
            Self::new(name.split('_').next()?).ok()
        };
        let mut domains: Vec<Self> = own.filter_map(name).collect();
        domains.sort_by(|a, b| a.name.cmp(&b.name));
        domains.dedup();
        let with_output = |domain: Self| {
            let output = std::fs::read(domain.root().join(OUTPUT)).ok();
            (domain, output.map(|bytes| PathBuf::from(std::ffi::OsStr::from_bytes(&bytes))))
        };
        Ok(domains.into_iter().map(with_output).collect())
    }

    /// Removes all files of this domain. Files of other users do not belong to it and stay. Call it only when none of
    /// its processes is running.
    pub fn wipe(&self) -> Result<(), IpcError> {
        let root = self.root();
        let remove = || if is_foreign(&root) { Ok(()) } else { std::fs::remove_dir_all(&root) };
        let mut removed = remove();
        for _ in 1..MAX_REMOVALS {
            if removed.as_ref().is_err_and(|error| error.kind() == std::io::ErrorKind::DirectoryNotEmpty) {
                removed = remove();
            }
        }
        ignore_absent("removing", &root, removed)?;
        for (file, _) in self.files()? {
            ignore_absent("removing", &file, std::fs::remove_file(&file))?;
        }
        Ok(())
    }

    /// Files of this domain and of this user in shared memory. Files that have disappeared are left out.
    fn files(&self) -> Result<Vec<(PathBuf, Metadata)>, IpcError> {
        let with_metadata = |file: PathBuf| std::fs::symlink_metadata(&file).ok().map(|metadata| (file, metadata));
        let files = self.entries()?.into_iter().filter_map(with_metadata);
        Ok(files.filter(|(_, metadata)| is_own(metadata)).collect())
    }

    /// Files of all users in shared memory whose names belong to this domain.
    fn entries(&self) -> Result<Vec<PathBuf>, IpcError> {
        listed(&self.prefix())
    }

    /// Whether a file in shared memory has no length yet. A process that opens such a file waits for its length, forever if the
    /// creating process was killed between the two calls (iceoryx2 0.10). Files too old to be in creation are removed. A file whose
    /// creator is killed after this check and before its use remains a risk.
    pub(crate) fn has_unfinished_files(&self) -> Result<bool, IpcError> {
        let mut unfinished = false;
        for (file, metadata) in self.files()? {
            if !metadata.is_file() || metadata.len() > 0 {
                continue;
            }
            // After the clock was set back, the age is unknown.
            let age = metadata.modified().ok().and_then(|made| made.elapsed().ok()).unwrap_or(MAX_CREATION);
            if age < MAX_CREATION {
                unfinished = true;
            } else {
                ignore_absent("removing", &file, std::fs::remove_file(&file))?;
            }
        }
        Ok(unfinished)
    }

    /// iceoryx2 makes its node counter readable and writable by all users; this makes it private, as a run is private
    /// to its owner.
    pub(crate) fn close_to_others(&self) -> Result<(), IpcError> {
        for (file, _) in self.files()? {
            if file.extension().is_some_and(|extension| extension == "global_mgmt") {
                // The file of a node that has just ended is absent.
                ignore_absent("closing", &file, ownership::close_to_others(&file))?;
            }
        }
        Ok(())
    }

    /// Bytes of shared memory in use by the domain.
    pub fn used_bytes(&self) -> u64 {
        use std::os::unix::fs::MetadataExt;
        let files = self.files().unwrap_or_default();
        // st_blocks counts units of 512 bytes whatever the file system's block size.
        files.iter().map(|(_, metadata)| metadata.blocks() * 512).sum()
    }
}

/// Files of all users in shared memory whose names start with `prefix`.
fn listed(prefix: &str) -> Result<Vec<PathBuf>, IpcError> {
    let io = |cause| IpcError::Io { what: format!("listing {SHARED_MEMORY}"), cause };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(SHARED_MEMORY).map_err(io)? {
        let entry = entry.map_err(io)?;
        if entry.file_name().to_string_lossy().starts_with(prefix) {
            files.push(entry.path());
        }
    }
    Ok(files)
}

fn ignore_absent(what: &str, path: &Path, result: std::io::Result<()>) -> Result<(), IpcError> {
    match result {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(IpcError::Io { what: format!("{what} {}", path.display()), cause })
        }
        _ => Ok(()),
    }
}

/// iceoryx2's form of a service name.
pub(crate) fn service_name(name: &str) -> Result<ServiceName, IpcError> {
    name.try_into().map_err(|cause| IpcError::transport(format!("service name {name:?}"), cause))
}
