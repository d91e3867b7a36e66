//! Errors of drives and live sensors that cannot be read or have no sweeps.

use crate::live::{LineAddress, LineAddressError};
use files::problems::FileError;
use lidar::SweepError;
use std::io;
use std::net::SocketAddrV4;
use std::path::PathBuf;

/// A live sensor that cannot be received, recorded or decoded.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The text is not an address.
    #[error("value {0:?} must be an IPv4 address and a port, for example 127.0.0.1:2368")]
    Address(String),
    /// There are more or fewer addresses than LiDARs.
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
    /// The address cannot be bound.
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
    /// The folder has no free numbers for captures.
    #[error("{}: holds {max} captures, the maximum; use another folder", folder.display())]
    Full {
        /// The folder.
        folder: PathBuf,
        /// Most captures of a folder.
        max: u32,
    },
    /// The folder of images cannot be watched.
    #[error("{}: the folder cannot be watched: {source}", path.display())]
    Watch {
        /// The folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The image folder is not a directory.
    #[error("{} is not a folder", .0.display())]
    NoFolder(PathBuf),
    /// The rig does not have the sensor.
    #[error("is set, but {rig} has no {what}")]
    NotInRig {
        /// The setting.
        key: &'static str,
        /// Entries of the manifest.
        what: &'static str,
        /// The rig.
        rig: String,
    },
    /// The text is not an address of lines.
    #[error("{source}")]
    Line {
        /// The setting.
        key: &'static str,
        /// Cause.
        source: LineAddressError,
    },
    /// The address of lines cannot be opened.
    #[error("{address} cannot be opened: {source}")]
    Open {
        /// The setting.
        key: &'static str,
        /// The address.
        address: LineAddress,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The manifest of the recording cannot be written.
    #[error("{}: the manifest cannot be written: {source}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// Encoding error.
        source: toml::ser::Error,
    },
    /// No packet has arrived.
    #[error(
        "no packet in {seconds:.0} s at {addresses} (limit quiet_s = {limit}); check cable and power of the LiDAR, and whether it sends to this address and port"
    )]
    Silent {
        /// Time since the start of the reception.
        seconds: f64,
        /// Time limit.
        limit: f64,
        /// The bound addresses.
        addresses: String,
    },
    /// The receiving thread cannot be started.
    #[error(transparent)]
    Thread(io::Error),
    /// The rig cannot be read.
    #[error(transparent)]
    Rig(#[from] FileError),
    /// The model contradicts the rig.
    #[error("value {setting:?} must be {rig:?}, the model of the rig, or empty")]
    Model {
        /// The wanted model.
        setting: String,
        /// The model of the rig.
        rig: String,
    },
    /// The packets of the model cannot be decoded without a file of the unit.
    #[error("packets of {model:?} need {file}; set run.rig to a drive.toml whose lidar.calibration names it")]
    Calibration {
        /// The wanted model.
        model: String,
        /// The file.
        file: &'static str,
    },
    /// The folder is outside the output folder.
    #[error("value {0:?} must be a path inside the output folder")]
    Outside(String),
    /// The folder has captures of an earlier run.
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
    /// The packets contain no sweep.
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
        /// Packets from any sender.
        n_packets: u64,
        /// Time limit.
        limit: f64,
        /// Description of the packets.
        reason: String,
    },
}

/// A recorded drive that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    /// The folder is not a drive.
    #[error(transparent)]
    Drive(#[from] FileError),
    /// The sweeps cannot be read.
    #[error(transparent)]
    Sweeps(#[from] SweepError),
    /// The log of the GNSS receiver or of the IMU cannot be read.
    #[error(transparent)]
    Log(io::Error),
    /// The position belongs to another drive.
    #[error("the saved state belongs to another drive")]
    OtherDrive,
}

impl LiveError {
    /// The setting of the stage that causes the error, if one does.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Address(_) | Self::Bind { .. } | Self::Listen { .. } | Self::Silent { .. } => "listen",
            Self::Outside(_) | Self::File { .. } | Self::Full { .. } | Self::Used { .. } | Self::Manifest { .. } => {
                "recording"
            }
            Self::Watch { .. } | Self::NoFolder(_) => "cameras",
            Self::NotInRig { key, .. } | Self::Line { key, .. } | Self::Open { key, .. } => key,
            Self::Model { .. } | Self::Calibration { .. } => "model",
            // `run.rig` is not a setting of the stage.
            Self::Rig(_) | Self::Thread(_) | Self::Sweep(_) | Self::NoSweep(_) => "",
        }
    }

    /// Whether files or the operating system, and not the settings or the data, are the cause.
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
