//! Writes images as a grabber does, in its own thread: a mosaic has megabytes, and packets must not wait for the disk.

use anyhow::{Context, anyhow};
use drive::{Drive, Frame, frame_stamp};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Images that may wait for the disk before packets wait as well.
const MAX_WAITING: usize = 256;

/// A copy from one file to another.
struct Job {
    from: PathBuf,
    to: PathBuf,
}

/// The thread that writes, started by the first image.
#[derive(Default)]
pub(super) struct ImageWriter {
    running: Option<(SyncSender<Job>, JoinHandle<anyhow::Result<()>>)>,
}

impl ImageWriter {
    /// Writes an image into a folder, with its stamp moved by `shift` ns. The error may belong to an earlier image.
    pub(super) fn write(&mut self, frame: &Frame, folder: &Path, shift: i64) -> anyhow::Result<()> {
        let extension = frame.path.extension().unwrap_or_default().to_string_lossy();
        // The receiver subtracts the camera's delay, as the reader of the drive has.
        let stamp = frame_stamp(&frame.path).unwrap_or(frame.stamp);
        let to = folder.join(format!("{}.{extension}", stamp.0.saturating_add(shift)));
        let job = Job { from: frame.path.clone(), to };
        if self.running.is_none() {
            let (sender, jobs) = sync_channel(MAX_WAITING);
            let thread = std::thread::Builder::new().name("images".to_owned());
            self.running = Some((sender, thread.spawn(move || write_all(&jobs)).context("cannot start a thread")?));
        }
        let is_taken = self.running.as_ref().is_some_and(|(sender, _)| sender.send(job).is_ok());
        if is_taken { Ok(()) } else { self.finish() }
    }

    /// Waits until all images are written.
    pub(super) fn finish(&mut self) -> anyhow::Result<()> {
        let Some((sender, thread)) = self.running.take() else { return Ok(()) };
        drop(sender);
        thread.join().map_err(|_| anyhow!("the thread that writes images panicked"))?
    }
}

fn write_all(jobs: &Receiver<Job>) -> anyhow::Result<()> {
    for Job { from, to } in jobs {
        // Written completely under a temporary name, then renamed.
        let name = to.file_name().unwrap_or_default().to_string_lossy();
        let partial = to.with_file_name(format!(".{name}.partial"));
        fs::copy(&from, &partial).with_context(|| format!("{} to {}", from.display(), partial.display()))?;
        fs::rename(&partial, &to).with_context(|| to.display().to_string())?;
    }
    Ok(())
}

/// Makes the folders of the drive's cameras in `root`, and copies dark and white frames.
pub(super) fn prepare_folders(drive: &Drive, root: &Path) -> anyhow::Result<()> {
    let manifest = drive.manifest();
    let cameras = manifest.cameras.iter().map(|entry| &entry.folder);
    for folder in cameras.chain(manifest.mosaics.iter().map(|entry| &entry.folder)) {
        let path = root.join(folder);
        fs::create_dir_all(&path).with_context(|| path.display().to_string())?;
        for name in ["dark", "white"] {
            copy_folder(&drive.folder().join(folder).join(name), &path.join(name))?;
        }
    }
    Ok(())
}

/// Copies the files of a folder and of its subfolders, if it exists.
fn copy_folder(source: &Path, target: &Path) -> anyhow::Result<()> {
    let Ok(entries) = fs::read_dir(source) else { return Ok(()) };
    fs::create_dir_all(target).with_context(|| target.display().to_string())?;
    for path in entries.flatten().map(|entry| entry.path()) {
        let to = target.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy_folder(&path, &to)?;
        } else {
            fs::copy(&path, &to).with_context(|| to.display().to_string())?;
        }
    }
    Ok(())
}
