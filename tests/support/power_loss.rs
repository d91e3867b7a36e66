//! Power loss: a file system that records the order of its changes and syncs, and every disk that a power loss at any
//! moment may leave.
//!
//! The file system keeps its content in memory and is mounted through `/dev/fuse` in a mount namespace, which needs no superuser.

mod crash;
mod disk;
mod protocol;
mod survival;

pub use crash::{Journal, Survives, Tree};
pub use survival::{RecordedRun, Survival};

use disk::Disk;
use protocol::{MAX_WRITE, parse, refusal};
use rustix::io::{FdFlags, fcntl_setfd};
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;

/// A mounted file system. The caller is in its own mount namespace.
pub struct RecordedDisk {
    folder: PathBuf,
    server: JoinHandle<Disk>,
    n_changes: Arc<AtomicUsize>,
}

impl RecordedDisk {
    /// Creates a folder and mounts an empty file system on it.
    ///
    /// # Panics
    /// If it cannot be mounted.
    pub fn mount(folder: &Path) -> Self {
        std::fs::create_dir_all(folder).expect("a folder");
        let device = File::options().read(true).write(true).open("/dev/fuse").expect("/dev/fuse can be opened");
        // `mount` gives the descriptor to the kernel.
        fcntl_setfd(&device, FdFlags::empty()).expect("inherited");
        let options = format!("fd={},rootmode=40000,user_id=0,group_id=0", device.as_raw_fd());
        let mut command = Command::new("mount");
        let status = command.args(["-i", "-t", "fuse", "-o", &options, "replica"]).arg(folder).status();
        assert!(status.expect("mount starts").success(), "{} cannot be mounted", folder.display());
        fcntl_setfd(&device, FdFlags::CLOEXEC).expect("not inherited any more");
        let n_changes = Arc::<AtomicUsize>::default();
        let counted = Arc::clone(&n_changes);
        let server = std::thread::Builder::new().name("disk".to_owned()).spawn(move || serve(device, &counted));
        Self { folder: folder.to_owned(), server: server.expect("a thread"), n_changes }
    }

    /// Number of changes so far.
    pub fn n_changes(&self) -> usize {
        self.n_changes.load(Ordering::Acquire)
    }

    /// Unmounts it. Returns all changes.
    ///
    /// # Panics
    /// If a process has files open there.
    pub fn unmount(self) -> Journal {
        let status = Command::new("umount").arg(&self.folder).status().expect("umount starts");
        assert!(status.success(), "{} is in use", self.folder.display());
        Journal::new(self.server.join().expect("the server ended well").log)
    }
}

/// Answers until the file system is unmounted.
fn serve(mut device: File, n_changes: &AtomicUsize) -> Disk {
    let mut disk = Disk::new();
    let mut buffer = vec![0; MAX_WRITE as usize + 4096];
    while let Ok(n) = device.read(&mut buffer) {
        let Some((unique, request)) = parse(&buffer[..n]) else { break };
        let Some(answer) = disk.answer(&request) else { continue };
        n_changes.store(disk.log.len(), Ordering::Release);
        let bytes = match answer {
            Ok(answer) => answer.into_message(unique),
            Err(errno) => refusal(unique, errno),
        };
        // The request of a killed process has no reader.
        let _ = device.write_all(&bytes);
    }
    disk
}
