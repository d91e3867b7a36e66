//! Errors of the transport.

use std::fmt::Debug;

/// An operation on shared memory that failed.
#[derive(Debug, thiserror::Error)]
pub enum IpcError {
    /// iceoryx2 refused.
    #[error("{what}: {cause}")]
    Transport {
        /// Operation and service.
        what: String,
        /// Name of iceoryx2's error.
        cause: String,
    },
    /// Fewer consumers got the message than there are: it would be lost.
    #[error("{service}: message {seq} reached {reached} of {expected} consumers")]
    Lost {
        /// Service.
        service: String,
        /// Message.
        seq: u64,
        /// Consumers that got it.
        reached: usize,
        /// Consumers that should have.
        expected: usize,
    },
    /// A message that does not match its own envelope or its type.
    #[error("{service}: message of {bytes} bytes cannot hold {len} rows of {row_bytes} bytes")]
    Torn {
        /// Service.
        service: String,
        /// Size of the payload.
        bytes: usize,
        /// Rows that it claims to have.
        len: usize,
        /// Size of a row.
        row_bytes: usize,
    },
    /// The consumer keeps more messages than the topic allows.
    #[error("{service}: more than {allowed} messages are held beyond their step")]
    HeldTooMany {
        /// Service.
        service: String,
        /// `Message::BORROWED`.
        allowed: usize,
    },
    /// The folder of a domain cannot be used.
    #[error("{}: {cause}", folder.display())]
    Folder {
        /// The folder.
        folder: std::path::PathBuf,
        /// Why.
        #[source]
        cause: crate::PrivateFolderError,
    },
    /// The operating system.
    #[error("{what}: {cause}")]
    Io {
        /// Operation and path.
        what: String,
        /// Why.
        #[source]
        cause: std::io::Error,
    },
}

/// More rows than a loan has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{topic}: {requested} more rows do not fit a loan of {capacity} rows with {used} written")]
pub struct LoanFull {
    /// Topic of the loan.
    pub topic: &'static str,
    /// Rows of the loan.
    pub capacity: usize,
    /// Rows written before.
    pub used: usize,
    /// Rows that were to follow.
    pub requested: usize,
}

impl IpcError {
    pub(crate) fn transport(what: impl Into<String>, cause: impl Debug) -> Self {
        IpcError::Transport { what: what.into(), cause: format!("{cause:?}") }
    }
}
