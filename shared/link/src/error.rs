//! Errors of connections to another host.

use std::path::PathBuf;

/// An error of a connection to another host.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The key file cannot be read or written.
    #[error("{}: {source}", file.display())]
    KeyFile {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// Other users could read or replace the key.
    #[error("{}: mode {mode:04o} lets other users read the key; use `chmod 600`", file.display())]
    KeyMode {
        /// The file.
        file: PathBuf,
        /// Its permissions.
        mode: u32,
    },
    /// The file has no key.
    #[error("{}: must have 64 hexadecimal digits, as `replica agent --new-key` writes them", file.display())]
    KeyContent {
        /// The file.
        file: PathBuf,
    },
    /// The address has no host or no port.
    #[error("{address}: {source}; must be HOST:PORT, e.g. gpu-box:7878")]
    Address {
        /// Address as given.
        address: String,
        /// The resolver's error.
        source: std::io::Error,
    },
    /// No agent listens there.
    #[error("{address}: {source}; does `replica agent` run there?")]
    Connect {
        /// The address.
        address: String,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The connection ended before it was established.
    #[error("{peer}: the connection ended during its start: {source}")]
    Ended {
        /// The other end.
        peer: String,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The other end does not speak this protocol.
    #[error("{peer} is not a `replica agent`")]
    Foreign {
        /// The other end.
        peer: String,
    },
    /// The other end speaks another version of the protocol.
    #[error("{peer} has version {got} of the link, this program has {expected}; install the same build on both hosts")]
    Version {
        /// The other end.
        peer: String,
        /// Its version.
        got: u32,
        /// The version of this program.
        expected: u32,
    },
    /// The keys differ.
    #[error("{peer} has another key")]
    Key {
        /// The other end.
        peer: String,
    },
    /// Too many connections have not shown the key yet.
    #[error("{peer}: not served, too many connections have not shown the key yet")]
    TooManyHandshakes {
        /// The other end.
        peer: String,
    },
    /// The agent serves no more connections.
    #[error("{peer}: not served, there are {limit} connections")]
    TooMany {
        /// The other end.
        peer: String,
        /// Largest number of connections.
        limit: usize,
    },
    /// The agent refuses to start the program.
    #[error("{peer} refuses: {text}")]
    Refused {
        /// The agent.
        peer: String,
        /// Reason.
        text: String,
    },
}

impl LinkError {
    /// Whether the same call may succeed later, when the network or the agent has recovered.
    pub fn is_temporary(&self) -> bool {
        matches!(self, Self::Connect { .. } | Self::Ended { .. })
    }
}
