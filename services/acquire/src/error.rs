//! Why a live sensor cannot be received or recorded, and what has no sweeps.

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
    #[error("value {0:?} must be a path inside the output folder")]
    Outside(String),
    #[error("{} holds {n} captures of an earlier run; use another folder", folder.display())]
    Used { folder: PathBuf, n: usize },
}

/// Packets or files without a sweep.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoSweepError {
    #[error(
        "no sweep in the {part} ({n_partial} partial, {n_packets} data packets, {n_foreign} foreign packets, {n_bad} unreadable \
         sweep files); check lidar.model, start_s, end_s and min_turn"
    )]
    Recorded { part: String, n_partial: u64, n_packets: u64, n_foreign: u64, n_bad: u64 },
    #[error("no sweep in {seconds:.1} s of packets ({n_packets} received, limit max_undecoded_s = {limit}): {reason}")]
    Live { seconds: f64, n_packets: u64, limit: f64, reason: String },
}

impl LiveError {
    /// The setting that causes it, where one does.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            Self::Address(_) | Self::Bind { .. } => "listen",
            Self::Outside(_) | Self::File { .. } | Self::Full { .. } | Self::Used { .. } | Self::Manifest { .. } => {
                "recording"
            }
            // `run.rig` is no setting of acquire.
            Self::Rig(_) => "",
            Self::Model { .. } => "model",
        }
    }
}
