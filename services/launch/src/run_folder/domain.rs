//! `run/domain`: the name of the run in shared memory. It is unpredictable, so nobody can prepare files of that name.
//! It stays the same for all runs into the output: the next run finds the files that a killed one has left.
//!
//! A second line identifies the folder that holds the file: in a copy of the folder, such as a backup, the name still
//! belongs to the runs of the original, which may be running.

use super::{RunFolderError, cannot_write, read};
use files::atomic_file::AtomicFile;
use ipc::{Domain, is_foreign};
use run::control::socket_of;
use std::fs::Permissions;
use std::io::Write;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;

/// The name for the next run into `output`, absolute and without links: the name of the previous run, unless another
/// user has files of that name. Removes files that killed runs into this output have left under other names. The caller
/// holds the lock of the run.
pub fn take(file: &Path, output: &Path) -> Result<Domain, RunFolderError> {
    let domain = match last(file) {
        Some(domain) if !is_taken(&domain)? => domain,
        taken => {
            // Files left by a killed run are removed; the files of the other user stay.
            taken.map_or(Ok(()), |taken| taken.wipe())?;
            let domain = Domain::random()?;
            write_with_folder(file, &domain).map_err(|source| cannot_write(file, source))?;
            domain
        }
    };
    // A folder that was removed and created again has lost its names.
    for left in Domain::find_abandoned(output)?.into_iter().filter(|left| *left != domain) {
        left.wipe()?;
    }
    Ok(domain)
}

/// The name of the last run in the folder of `file`, if there was one.
pub fn last(file: &Path) -> Option<Domain> {
    let bytes = read(file).ok()?;
    let (name, folder) = std::str::from_utf8(&bytes).ok()?.split_once('\n')?;
    let is_here = folder == folder_of(file).ok()?;
    if is_here { Domain::new(name).ok() } else { None }
}

/// Device and inode of the folder that holds a file.
fn folder_of(file: &Path) -> std::io::Result<String> {
    let folder = file.parent().unwrap_or(file).metadata()?;
    Ok(format!("{} {}", folder.dev(), folder.ino()))
}

/// Whether another user has files of the name.
fn is_taken(domain: &Domain) -> Result<bool, RunFolderError> {
    Ok(domain.is_taken()? || socket_of(domain.name()).parent().is_some_and(is_foreign))
}

/// Writes the name and the identity of the folder to a file that only this user can read.
fn write_with_folder(path: &Path, domain: &Domain) -> std::io::Result<()> {
    let text = format!("{}\n{}", domain.name(), folder_of(path)?);
    let file = AtomicFile::create(path)?;
    file.file().set_permissions(Permissions::from_mode(0o600))?;
    file.file().write_all(text.as_bytes())?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_into_one_output_have_one_name_and_others_have_others() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("domain");
        let first = take(&file, folder.path()).expect("a name");
        assert_eq!(take(&file, folder.path()).expect("a name"), first);
        assert_eq!(last(&file), Some(first.clone()));
        assert_eq!(std::fs::metadata(&file).expect("written").mode() & 0o077, 0, "others cannot read it");
        let other = take(&folder.path().join("other"), folder.path()).expect("a name");
        assert_ne!(other, first);
        let foreign = format!("../x\n{}", folder_of(&file).expect("a folder"));
        std::fs::write(&file, foreign).expect("written");
        assert_eq!(last(&file), None);
    }

    #[test]
    fn copied_file_does_not_take_the_name_of_the_original() {
        let original = tempfile::tempdir().expect("a folder");
        let copy = tempfile::tempdir().expect("a folder");
        let file = original.path().join("domain");
        let running = take(&file, original.path()).expect("a name");
        drop(running.node("supervisor").expect("a node"));
        let copied = copy.path().join("domain");
        std::fs::copy(&file, &copied).expect("copied");
        assert_eq!(last(&copied), None);
        assert_ne!(take(&copied, copy.path()).expect("a name"), running);
        assert!(running.root().exists(), "the files of the original stay");
        assert_eq!(take(&file, original.path()).expect("a name"), running);
        running.wipe().expect("removed");
    }

    #[test]
    fn memory_of_a_run_whose_output_was_removed_is_found_by_the_next_one() {
        let output = tempfile::tempdir().expect("a folder");
        let file = output.path().join("domain");
        let killed = take(&file, output.path()).expect("a name");
        drop(killed.node("supervisor").expect("a node"));
        killed.write_output(output.path()).expect("written");
        std::fs::remove_file(&file).expect("removed");
        let next = take(&file, output.path()).expect("a name");
        assert_ne!(next, killed);
        assert!(!killed.root().exists(), "wiped");
    }
}
