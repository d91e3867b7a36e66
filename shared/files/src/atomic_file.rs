//! Files that are either complete or absent, even after a crash of the process or a power failure.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A file that is written as `.<name>.partial` until [`AtomicFile::commit`] renames it. Without a commit it is removed on drop. A
/// partial file left by a crash is overwritten by the next writer of the same name.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    partial: PathBuf,
    file: Option<File>,
}

impl AtomicFile {
    /// Opens the partial file for writing. The folder must exist.
    pub fn create(path: &Path) -> io::Result<Self> {
        let name = path.file_name().ok_or_else(|| io::Error::other("the path has no file name"))?;
        let partial = path.with_file_name(format!(".{}.partial", name.to_string_lossy()));
        let file = Some(create_anew(&partial)?);
        Ok(Self { path: path.to_owned(), partial, file })
    }

    /// Final path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The open file.
    pub fn file(&self) -> &File {
        self.file.as_ref().expect("taken when committed, which consumes self")
    }

    /// Syncs the content, renames the file to its final name and syncs the folder.
    pub fn commit(self) -> io::Result<()> {
        // In another order, a power failure could leave an empty file with the final name.
        self.file().sync_all()?;
        let path = self.path.clone();
        self.commit_unsynced()?;
        sync_folder(&path)
    }

    /// Renames the file to its final name without syncing. Other processes see a complete file, but it may be lost in a power
    /// failure. Call [`sync_all`] before anything relies on it.
    pub fn commit_unsynced(mut self) -> io::Result<()> {
        fs::rename(&self.partial, &self.path)?;
        self.file = None;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if self.file.take().is_some() {
            // A failure cannot be reported here, and the next writer overwrites the file.
            let _ = fs::remove_file(&self.partial);
        }
    }
}

/// Creates a file after removing an existing one. An existing link is removed, not followed: in a folder shared by
/// several users it could point to any file of this user.
fn create_anew(path: &Path) -> io::Result<File> {
    let create = || File::options().write(true).create_new(true).open(path);
    match create() {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            fs::remove_file(path)?;
            create()
        }
        created => created,
    }
}

/// Writes a small file.
pub fn write_atomic(path: &Path, content: &[u8]) -> io::Result<()> {
    let file = AtomicFile::create(path)?;
    io::Write::write_all(&mut file.file(), content)?;
    file.commit()
}

/// Syncs a file and its folder to the disk.
pub fn sync(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()?;
    sync_folder(path)
}

/// Syncs files and their folders to the disk, one after the other. Syncing on several threads would not be faster and would block
/// threads that compute. The error belongs to the first file that failed.
pub fn sync_all(paths: &[PathBuf]) -> Result<(), (PathBuf, io::Error)> {
    paths.iter().try_for_each(|path| sync(path).map_err(|cause| (path.clone(), cause)))
}

/// A rename is durable when the folder is synced.
fn sync_folder(path: &Path) -> io::Result<()> {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => File::open(folder)?.sync_all(),
        _ => File::open(".")?.sync_all(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn link_with_the_name_of_the_partial_file_is_not_followed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cloud.ply");
        let target = folder.path().join("keys");
        let partial = folder.path().join(".cloud.ply.partial");
        fs::write(&target, b"of the user").expect("writes");
        std::os::unix::fs::symlink(&target, &partial).expect("links");
        write_atomic(&path, b"points").expect("writes");
        assert_eq!(
            (fs::read(&path).expect("is there"), fs::read(&target).expect("is there")),
            (b"points".to_vec(), b"of the user".to_vec())
        );
        assert!(!partial.exists());
        // A partial file left by a crash is also overwritten.
        fs::write(&partial, b"half of a longer text").expect("writes");
        write_atomic(&path, b"new").expect("writes");
        assert_eq!(fs::read(&path).expect("is there"), b"new");
    }

    #[test]
    fn uncommitted_file_is_removed_and_keeps_the_old_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cloud.ply");
        write_atomic(&path, b"old").expect("writes");
        let unfinished = AtomicFile::create(&path).expect("opens");
        io::Write::write_all(&mut unfinished.file(), b"half").expect("writes");
        drop(unfinished);
        assert_eq!(fs::read(&path).expect("is there"), b"old");
        assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 1);
        write_atomic(&path, b"new").expect("writes");
        assert_eq!(fs::read(&path).expect("is there"), b"new");
    }
}
