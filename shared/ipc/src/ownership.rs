//! Whose files are in folders that all users can write to, such as `/dev/shm` and `/tmp`. Files of other users are neither
//! followed nor changed nor removed: they may have been put there to be mistaken for ours.

use rustix::fs::OFlags;
use rustix::process::geteuid;
use std::fs::{File, Metadata, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;

/// Why a folder cannot be used for files that other users must not reach.
#[derive(Debug, thiserror::Error)]
pub enum PrivateFolderError {
    /// The operating system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It was there before, and is a link or not a folder.
    #[error("is not a folder")]
    NoFolder,
    /// It was there before, and another user has made it.
    #[error("belongs to another user (uid {uid})")]
    Foreign {
        /// The owner.
        uid: u32,
    },
    /// It was there before, and others may enter it.
    #[error("is open to other users (mode {mode:03o})")]
    Open {
        /// Its mode.
        mode: u32,
    },
}

/// Whether a file, not what it links to, belongs to another user. An absent file belongs to none.
pub fn is_foreign(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|metadata| !is_own(&metadata))
}

/// Whether a file belongs to this user.
pub(crate) fn is_own(metadata: &Metadata) -> bool {
    metadata.uid() == geteuid().as_raw()
}

/// Makes a folder that no other user can enter. One that is there must be such a folder, and belong to this user.
pub fn create_private_folder(path: &Path) -> Result<(), PrivateFolderError> {
    match std::fs::DirBuilder::new().mode(0o700).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => check_private_folder(path),
        created => Ok(created?),
    }
}

/// Whether a folder belongs to this user and no other user can enter it. Then nobody else can replace it: the folders above it
/// let each user remove only own files.
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

/// Takes the rights of other users away from a file of this user. Links, and files of others, stay as they are.
pub(crate) fn close_to_others(path: &Path) -> io::Result<()> {
    // A pipe that nobody writes to must not block.
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
