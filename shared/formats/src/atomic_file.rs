//! Files that are there whole or not at all, whatever happens to the process or the machine.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A file under construction beside its place: `.<name>.partial` until [`AtomicFile::commit`] renames it. Dropped
/// before that, it is removed; left by a crash, the next writer of the same name takes it over.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    partial: PathBuf,
    file: Option<File>,
}

impl AtomicFile {
    /// Opens the partial file for writing. The folder must exist.
    pub fn create(path: &Path) -> io::Result<Self> {
        let name = path.file_name().ok_or_else(|| io::Error::other("the path names no file"))?;
        let partial = path.with_file_name(format!(".{}.partial", name.to_string_lossy()));
        let file = Some(File::create(&partial)?);
        Ok(Self { path: path.to_owned(), partial, file })
    }

    /// Where the file will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The open file.
    pub fn file(&self) -> &File {
        self.file.as_ref().expect("taken when committed, which consumes self")
    }

    /// Brings the content to the disk, then renames it into place and brings the name to the disk.
    pub fn commit(self) -> io::Result<()> {
        // Without this order a power cut could leave the new name with an empty file behind it.
        self.file().sync_all()?;
        let path = self.path.clone();
        self.commit_unsynced()?;
        sync_folder(&path)
    }

    /// Renames the content into place. Whole for every process, but a power cut may take it: before anything relies on it,
    /// [`sync_all`].
    pub fn commit_unsynced(mut self) -> io::Result<()> {
        fs::rename(&self.partial, &self.path)?;
        self.file = None;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if self.file.take().is_some() {
            // Nobody is left to hear of a failure, and the next writer takes the file over.
            let _ = fs::remove_file(&self.partial);
        }
    }
}

/// Writes a whole small file at once.
pub fn write_atomic(path: &Path, content: &[u8]) -> io::Result<()> {
    let file = AtomicFile::create(path)?;
    io::Write::write_all(&mut file.file(), content)?;
    file.commit()
}

/// Brings a file and its name to the disk.
pub fn sync(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()?;
    sync_folder(path)
}

/// Brings files and their names to the disk, one after the other: the disk is busy with each, and threads that compute are not to
/// wait for it. The error is of the first that failed.
pub fn sync_all(paths: &[PathBuf]) -> Result<(), (PathBuf, io::Error)> {
    paths.iter().try_for_each(|path| sync(path).map_err(|cause| (path.clone(), cause)))
}

/// A rename is durable when its folder is.
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
    fn a_file_that_is_not_committed_leaves_nothing_and_spares_the_old_one() {
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
