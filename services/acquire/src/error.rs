//! Why a live sensor cannot be received or recorded.

use std::io;
use std::net::SocketAddrV4;
use std::path::PathBuf;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LiveError {
    #[error("value {0:?} must be an IPv4 address and a port, for example 127.0.0.1:2368")]
    Address(String),
    #[error("{address} cannot be bound: {source}")]
    Bind { address: SocketAddrV4, source: io::Error },
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    #[error("{}: holds {max} captures, the maximum; use another folder", folder.display())]
    Full { folder: PathBuf, max: u32 },
    #[error("{}: the manifest cannot be written: {source}", path.display())]
    Manifest { path: PathBuf, source: toml::ser::Error },
    #[error(transparent)]
    Rig(#[from] formats::problems::FileError),
    #[error("value {setting:?} must be {rig:?}, the model of the rig, or empty")]
    Model { setting: String, rig: String },
    #[error("{} holds {n} captures of an earlier run; use another folder", folder.display())]
    Used { folder: PathBuf, n: usize },
}

impl LiveError {
    /// The setting that causes it, where one does.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            Self::Address(_) | Self::Bind { .. } => "listen",
            Self::File { .. } | Self::Full { .. } | Self::Used { .. } | Self::Manifest { .. } => "recording",
            // `run.rig` is no setting of acquire.
            Self::Rig(_) => "",
            Self::Model { .. } => "model",
        }
    }
}
