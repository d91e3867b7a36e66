//! Syncing clouds to the disk.

use formats::atomic_file::sync_all;
use formats::ply::PlyWriter;
use stage::StepError;
use std::path::PathBuf;
use std::sync::mpsc::sync_channel;

/// Most clouds that wait for syncing. They are open and may be in the page cache.
const MAX_WAITING: usize = 4;

/// Syncs files to the disk.
pub(crate) fn sync(files: &[PathBuf]) -> Result<(), StepError> {
    let fault =
        |(path, cause): (PathBuf, _)| StepError::io(format!("{}: cannot sync to the disk: {cause}", path.display()));
    sync_all(files).map_err(fault)
}

/// Runs `work` while a thread syncs these files, then the clouds that `work` passes on, which get their names when they are synced.
pub(crate) fn sync_in_background(
    files: &[PathBuf],
    work: impl FnOnce(&(dyn Fn(PlyWriter) -> Result<(), StepError> + Sync)) -> Result<(), StepError>,
) -> Result<(), StepError> {
    std::thread::scope(|scope| {
        let (done, waiting) = sync_channel::<PlyWriter>(MAX_WAITING);
        let sync_all = move || {
            sync(files)?;
            waiting.iter().try_for_each(|cloud| cloud.finish().map(drop).map_err(StepError::io))
        };
        let thread = std::thread::Builder::new().name("syncing".to_owned()).spawn_scoped(scope, sync_all);
        let thread = thread.map_err(StepError::io)?;
        let worked =
            work(&|cloud| done.send(cloud).map_err(|_| StepError::io("the thread that syncs clouds has stopped")));
        drop(done);
        // A failure of the thread is the cause of a failure of `work`.
        thread.join().unwrap_or_else(|_| Err(StepError::io("the thread that syncs clouds panicked")))?;
        worked
    })
}
