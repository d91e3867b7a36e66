//! Services of another run's domain, opened by an observer.

use crate::ownership::{PrivateFolderError, check_private_folder};
use crate::{Domain, IpcError, Node};
use rustix::process::geteuid;
use std::fs::File;
use std::ops::{Deref, DerefMut};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

/// Services that an observer has opened in a domain.
///
/// The run may end at any moment, and its next attempt creates services of the same names. iceoryx2 removes a service, by
/// its name, when the last process closes it: an observer that closes late would remove the services of the next attempt.
/// Services of a domain that has been removed since are therefore not closed. They hold nothing outside this process:
/// it was removed with the domain.
pub struct Attached<T> {
    /// Taken out only when dropped.
    opened: Option<(T, Node)>,
    path: PathBuf,
    /// The open folder: while it is open, no other folder gets its inode number.
    root: File,
}

impl Domain {
    /// Joins the domain as the node `name` and opens services in it with `open`. Fails if no run has created the
    /// domain.
    pub fn attach<T>(
        &self,
        name: &str,
        open: impl FnOnce(&Node) -> Result<T, IpcError>,
    ) -> Result<Attached<T>, IpcError> {
        let path = self.root();
        let root =
            File::open(&path).map_err(|cause| IpcError::Io { what: format!("no run at {}", path.display()), cause })?;
        match check_private_folder(&path) {
            Ok(()) => {}
            // The superuser may observe the runs of other users.
            Err(PrivateFolderError::Foreign { .. }) if geteuid().is_root() => {}
            Err(cause) => return Err(IpcError::Folder { folder: path, cause }),
        }
        let node = self.node_inside(&path, name)?;
        let opened = open(&node)?;
        Ok(Attached { opened: Some((opened, node)), path, root })
    }
}

impl<T> Attached<T> {
    /// Whether the domain is still the one in which the services were opened.
    pub fn is_current(&self) -> bool {
        let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
        match (std::fs::metadata(&self.path), self.root.metadata()) {
            (Ok(there), Ok(opened)) => identity(there) == identity(opened),
            _ => false,
        }
    }
}

impl<T> Deref for Attached<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.opened.as_ref().expect(OPEN).0
    }
}

impl<T> DerefMut for Attached<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.opened.as_mut().expect(OPEN).0
    }
}

/// Reason why `Attached` always has something open.
const OPEN: &str = "only `drop` takes it out";

impl<T> Drop for Attached<T> {
    fn drop(&mut self) {
        let current = self.is_current();
        let opened = self.opened.take();
        if !current {
            std::mem::forget(opened);
        }
    }
}
