//! Looking into a domain that lives and dies with somebody else's run.

use crate::{Domain, IpcError, Node};
use std::fs::File;
use std::ops::{Deref, DerefMut};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

/// What an onlooker has opened in a domain.
///
/// The run may end at any moment, and its next attempt makes services of the same names. iceoryx2 removes a service, by
/// its name, when the last who had it open closes it: an onlooker that closes late would take the next attempt's services
/// away. So what was opened in a domain that has been wiped since is not closed; all that it had outside this process
/// went with the domain.
pub struct Visit<T> {
    /// Taken out only when dropped.
    opened: Option<(T, Node)>,
    path: PathBuf,
    /// As long as the folder is open, no other gets its number.
    root: File,
}

impl Domain {
    /// Joins the domain under `name` and opens there what `open` does. Fails if no run has made it.
    pub fn visit<T>(&self, name: &str, open: impl FnOnce(&Node) -> Result<T, IpcError>) -> Result<Visit<T>, IpcError> {
        let path = self.root();
        let root =
            File::open(&path).map_err(|cause| IpcError::Io { what: format!("no run at {}", path.display()), cause })?;
        let node = self.node(name)?;
        let opened = open(&node)?;
        Ok(Visit { opened: Some((opened, node)), path, root })
    }
}

impl<T> Visit<T> {
    /// Whether the domain is still that in which everything was opened.
    pub fn is_current(&self) -> bool {
        let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
        match (std::fs::metadata(&self.path), self.root.metadata()) {
            (Ok(there), Ok(opened)) => identity(there) == identity(opened),
            _ => false,
        }
    }
}

impl<T> Deref for Visit<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.opened.as_ref().expect(OPEN).0
    }
}

impl<T> DerefMut for Visit<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.opened.as_mut().expect(OPEN).0
    }
}

/// Why a visit always has something open.
const OPEN: &str = "only `drop` takes it out";

impl<T> Drop for Visit<T> {
    fn drop(&mut self) {
        let current = self.is_current();
        let opened = self.opened.take();
        if !current {
            std::mem::forget(opened);
        }
    }
}
