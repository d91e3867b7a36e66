//! Clouds come to the disk while others are moved.

use formats::atomic_file::sync_all;
use formats::ply::PlyWriter;
use stage::StepError;
use std::path::PathBuf;
use std::sync::mpsc::sync_channel;

/// Clouds that wait for the disk at most, open and maybe in memory.
const MAX_WAITING: usize = 4;

/// Brings files to the disk.
pub(crate) fn sync(files: &[PathBuf]) -> Result<(), StepError> {
    let fault =
        |(path, cause): (PathBuf, _)| StepError::io(format!("{}: cannot bring to the disk: {cause}", path.display()));
    sync_all(files).map_err(fault)
}

/// Does `work` while a thread brings these files to the disk, then the clouds that `work` hands over, which only then have their
/// names.
pub(crate) fn meanwhile(
    files: &[PathBuf],
    work: impl FnOnce(&(dyn Fn(PlyWriter) -> Result<(), StepError> + Sync)) -> Result<(), StepError>,
) -> Result<(), StepError> {
    std::thread::scope(|scope| {
        let (done, waiting) = sync_channel::<PlyWriter>(MAX_WAITING);
        let bring = move || {
            sync(files)?;
            waiting.iter().try_for_each(|cloud| cloud.finish().map(drop).map_err(StepError::io))
        };
        let thread = std::thread::Builder::new().name("syncing".to_owned()).spawn_scoped(scope, bring);
        let thread = thread.map_err(StepError::io)?;
        let worked = work(&|cloud| done.send(cloud).map_err(|_| StepError::io("nobody brings clouds to the disk")));
        drop(done);
        // Its failure is the cause of the other.
        thread.join().unwrap_or_else(|_| Err(StepError::io("the thread that brings clouds to the disk panicked")))?;
        worked
    })
}
