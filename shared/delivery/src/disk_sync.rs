//! Syncing clouds to the disk.

use crate::error::DeliveryError;
use files::atomic_file::sync_all;
use formats::ply::PlyWriter;
use std::path::PathBuf;
use std::sync::mpsc::sync_channel;

/// Largest number of clouds that wait for syncing. They are open and may be in the page cache.
const MAX_WAITING: usize = 4;

/// Syncs files to the disk.
pub fn sync(files: &[PathBuf]) -> Result<(), DeliveryError> {
    sync_all(files).map_err(|(path, source)| DeliveryError::File { path, action: "sync to the disk", source })
}

/// Runs `work` while a thread syncs these files, then the clouds that `work` passes to it. A cloud gets its final name
/// when it is synced.
pub fn sync_in_background(
    files: &[PathBuf],
    work: impl FnOnce(&(dyn Fn(PlyWriter) -> Result<(), DeliveryError> + Sync)) -> Result<(), DeliveryError>,
) -> Result<(), DeliveryError> {
    std::thread::scope(|scope| {
        let (done, waiting) = sync_channel::<PlyWriter>(MAX_WAITING);
        let sync_all = move || {
            sync(files)?;
            Ok(waiting.iter().try_for_each(|cloud| cloud.finish().map(drop))?)
        };
        let thread = std::thread::Builder::new().name("syncing".to_owned()).spawn_scoped(scope, sync_all);
        let thread = thread.map_err(DeliveryError::Thread)?;
        let worked = work(&|cloud| done.send(cloud).map_err(|_| DeliveryError::SyncStopped));
        drop(done);
        // A failure of the thread may cause a failure of `work`, so it is reported first.
        thread.join().unwrap_or_else(|_| Err(DeliveryError::SyncPanicked))?;
        worked
    })
}
