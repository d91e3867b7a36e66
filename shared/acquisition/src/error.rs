//! Why a drive or a live sensor cannot be read, and what has no sweeps.

use crate::live::{LineAddress, LineAddressError};
use files::problems::FileError;
use lidar::SweepError;
use std::io;
use std::net::SocketAddrV4;
use std::path::PathBuf;

/// Why a live sensor cannot be received, recorded or decoded.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// Text that is no address.
    #[error("value {0:?} must be an IPv4 address and a port, for example 127.0.0.1:2368")]
    Address(String),
    /// More or fewer addresses than LiDARs.
    #[error(
        "{n_addresses} address(es) for {n_lidars} LiDAR(s); give one address for each LiDAR of the rig, in its order, separated by \
         commas"
    )]
    Listen {
        /// Addresses of the setting.
        n_addresses: usize,
        /// LiDARs of the rig.
        n_lidars: usize,
    },
    /// An address that cannot be listened on.
    #[error("{address} cannot be bound: {source}")]
    Bind {
        /// The address.
        address: SocketAddrV4,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A file of the recording.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A folder without free numbers for captures.
    #[error("{}: holds {max} captures, the maximum; use another folder", folder.display())]
    Full {
        /// The folder.
        folder: PathBuf,
        /// Most captures of a folder.
        max: u32,
    },
    /// A folder of images that cannot be watched.
    #[error("{}: the folder cannot be watched: {source}", path.display())]
    Watch {
        /// The folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A folder of images that is none.
    #[error("{} is not a folder", .0.display())]
    NoFolder(PathBuf),
    /// A sensor that the rig does not have.
    #[error("is set, but {rig} has no {what}")]
    NotInRig {
        /// The setting.
        key: &'static str,
        /// Entries of the manifest.
        what: &'static str,
        /// The rig.
        rig: String,
    },
    /// Text that is no address of lines.
    #[error("{source}")]
    Line {
        /// The setting.
        key: &'static str,
        /// What is wrong.
        source: LineAddressError,
    },
    /// An address of lines that cannot be opened.
    #[error("{address} cannot be opened: {source}")]
    Open {
        /// The setting.
        key: &'static str,
        /// The address.
        address: LineAddress,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The manifest of the recording.
    #[error("{}: the manifest cannot be written: {source}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// Why it cannot be encoded.
        source: toml::ser::Error,
    },
    /// The receiving thread cannot be started.
    #[error(transparent)]
    Thread(io::Error),
    /// A rig that cannot be read.
    #[error(transparent)]
    Rig(#[from] FileError),
    /// A model that contradicts the rig.
    #[error("value {setting:?} must be {rig:?}, the model of the rig, or empty")]
    Model {
        /// The wanted model.
        setting: String,
        /// The model of the rig.
        rig: String,
    },
    /// A model whose packets cannot be decoded without a file of the unit.
    #[error("packets of {model:?} need {file}; set run.rig to a drive.toml whose lidar.calibration names it")]
    Calibration {
        /// The wanted model.
        model: String,
        /// The file.
        file: &'static str,
    },
    /// A folder elsewhere.
    #[error("value {0:?} must be a path inside the output folder")]
    Outside(String),
    /// A folder with captures of an earlier run.
    #[error("{} holds {n} captures of an earlier run; use another folder", folder.display())]
    Used {
        /// The folder.
        folder: PathBuf,
        /// Number of captures.
        n: usize,
    },
    /// The recording cannot be decoded.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// Packets without a sweep.
    #[error(transparent)]
    NoSweep(#[from] NoSweepError),
}

/// Packets or files without a sweep.
#[derive(Debug, thiserror::Error)]
pub enum NoSweepError {
    /// A recorded drive.
    #[error(
        "no sweep in the {part} ({n_partial} partial, {n_packets} data packets, {n_foreign} foreign packets, {n_bad} unreadable \
         sweep files); check lidar.model, start_s, end_s and min_turn"
    )]
    Recorded {
        /// The part of the drive that was read.
        part: String,
        /// Sweeps of less than the least share of a revolution.
        n_partial: u64,
        /// Data packets of the LiDAR.
        n_packets: u64,
        /// Packets of other devices.
        n_foreign: u64,
        /// Cloud files that cannot be read.
        n_bad: u64,
    },
    /// A sensor on the network.
    #[error("no sweep in {seconds:.1} s of packets ({n_packets} received, limit max_undecoded_s = {limit}): {reason}")]
    Live {
        /// Time from the first to the last packet.
        seconds: f64,
        /// Packets of any sender.
        n_packets: u64,
        /// The limit of the time.
        limit: f64,
        /// What the packets are.
        reason: String,
    },
}

/// Why a recorded drive cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    /// The folder is no drive.
    #[error(transparent)]
    Drive(#[from] FileError),
    /// The sweeps.
    #[error(transparent)]
    Sweeps(#[from] SweepError),
    /// The log of the GNSS receiver or of the IMU.
    #[error(transparent)]
    Log(io::Error),
    /// A position in another drive.
    #[error("the saved state belongs to another drive")]
    OtherDrive,
}

impl LiveError {
    /// The setting of the stage that causes it, where one does.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Address(_) | Self::Bind { .. } | Self::Listen { .. } => "listen",
            Self::Outside(_) | Self::File { .. } | Self::Full { .. } | Self::Used { .. } | Self::Manifest { .. } => {
                "recording"
            }
            Self::Watch { .. } | Self::NoFolder(_) => "cameras",
            Self::NotInRig { key, .. } | Self::Line { key, .. } | Self::Open { key, .. } => key,
            Self::Model { .. } | Self::Calibration { .. } => "model",
            // `run.rig` is no setting of the stage.
            Self::Rig(_) | Self::Thread(_) | Self::Sweep(_) | Self::NoSweep(_) => "",
        }
    }

    /// Whether files or the operating system are the cause, and not the settings or the data.
    pub fn is_of_files(&self) -> bool {
        matches!(
            self,
            Self::Bind { .. }
                | Self::Open { .. }
                | Self::Watch { .. }
                | Self::File { .. }
                | Self::Full { .. }
                | Self::Manifest { .. }
                | Self::Thread(_)
        )
    }
}
