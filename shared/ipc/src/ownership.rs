//! Ownership of files in folders that all users can write to, such as `/dev/shm` and `/tmp`. Files of other users are
//! neither followed nor changed nor removed: they may imitate files of this user.

use rustix::fs::OFlags;
use rustix::process::geteuid;
use std::fs::{File, Metadata, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;

/// A folder that cannot be used for files that other users must not reach.
#[derive(Debug, thiserror::Error)]
pub enum PrivateFolderError {
    /// The operating system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The path exists, and is a link or not a folder.
    #[error("is not a folder")]
    NoFolder,
    /// The folder exists, and another user has created it.
    #[error("belongs to another user (uid {uid})")]
    Foreign {
        /// The owner.
        uid: u32,
    },
    /// The folder exists, and other users may enter it.
    #[error("is open to other users (mode {mode:03o})")]
    Open {
        /// Its mode.
        mode: u32,
    },
}

/// Whether a file, not the target of a link, belongs to another user. False for an absent file.
pub fn is_foreign(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|metadata| !is_own(&metadata))
}

/// Whether a file belongs to this user.
pub(crate) fn is_own(metadata: &Metadata) -> bool {
    metadata.uid() == geteuid().as_raw()
}

/// Creates a folder that no other user can enter. An existing one must be such a folder, and belong to this user.
pub fn create_private_folder(path: &Path) -> Result<(), PrivateFolderError> {
    match std::fs::DirBuilder::new().mode(0o700).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => check_private_folder(path),
        created => Ok(created?),
    }
}

/// Checks that a folder belongs to this user and no other user can enter it. Then nobody else can replace it: the
/// folders above it let each user remove only own files.
pub(crate) fn check_private_folder(path: &Path) -> Result<(), PrivateFolderError> {
    let metadata = std::fs::symlink_metadata(path)?;
    if !metadata.is_dir() {
        return Err(PrivateFolderError::NoFolder);
    }
    if !is_own(&metadata) {
        return Err(PrivateFolderError::Foreign { uid: metadata.uid() });
    }
    match metadata.mode() & 0o777 {
        mode if mode & 0o077 == 0 => Ok(()),
        mode => Err(PrivateFolderError::Open { mode }),
    }
}

/// Removes the permissions of other users from a file of this user. Links and foreign files stay unchanged.
pub(crate) fn close_to_others(path: &Path) -> io::Result<()> {
    // A pipe without a writer must not block.
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let file: File = match OpenOptions::new().read(true).custom_flags(flags.bits() as i32).open(path) {
        Err(_) if std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink() || !is_own(&metadata)) => {
            return Ok(());
        }
        opened => opened?,
    };
    let metadata = file.metadata()?;
    if metadata.is_file() && is_own(&metadata) { file.set_permissions(Permissions::from_mode(0o600)) } else { Ok(()) }
}
