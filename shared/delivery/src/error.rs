//! Errors of writing results.

use formats::ply::PlyError;
use geometry::UtmError;
use messages::{PlacementRow, SubmapError};
use std::io;
use std::path::PathBuf;

/// Reason why the files of a result cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum DeliveryError {
    /// A file or a folder cannot be accessed.
    #[error("{}: cannot {action}: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What failed, for example "write".
        action: &'static str,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A cloud cannot be written, read or moved.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// The thread that syncs clouds cannot be started.
    #[error(transparent)]
    Thread(io::Error),
    /// The thread that syncs clouds has ended before the last cloud.
    #[error("the thread that syncs clouds has stopped")]
    SyncStopped,
    /// The thread that syncs clouds has panicked; its message is on stderr.
    #[error("the thread that syncs clouds panicked")]
    SyncPanicked,
    /// A submap has an invalid header or point.
    #[error(transparent)]
    Submap(#[from] SubmapError),
    /// A number exceeds the range of PLY readers.
    #[error("{what} exceeds the PLY type int")]
    ExceedsInt {
        /// The submap and its number.
        what: String,
    },
    /// The rows of a column do not match the points.
    #[error("{column} of submap {seq}: {n_bytes} bytes are not {n_points} rows of {row_bytes} bytes")]
    ColumnSize {
        /// The column.
        column: &'static str,
        /// Number of the submap.
        seq: u64,
        /// Bytes of the rows.
        n_bytes: usize,
        /// Bytes of a row.
        row_bytes: usize,
        /// Points of the submap.
        n_points: usize,
    },
    /// The sizes of a spectra column contradict each other or the submap.
    #[error(
        "spectra of submap {seq}: {n_words} words are not {n_indices} indices and {n_spectra} spectra of {n_bands} bands for \
         {n_points} points"
    )]
    SpectraSize {
        /// Number of the submap.
        seq: u64,
        /// Words of the column.
        n_words: usize,
        /// Points by the header of the column.
        n_indices: u32,
        /// Spectra by the header of the column.
        n_spectra: u32,
        /// Bands by the header of the column.
        n_bands: u32,
        /// Points of the submap.
        n_points: usize,
    },
    /// A point refers to a spectrum that does not exist.
    #[error("spectra of submap {seq}: point {point} refers to spectrum {index} of {n_spectra}")]
    SpectrumIndex {
        /// Number of the submap.
        seq: u64,
        /// Number of the point.
        point: usize,
        /// Its spectrum.
        index: u32,
        /// Spectra of the column.
        n_spectra: u32,
    },
    /// The origin is not a valid position.
    #[error("placement: origin {} {} {altitude_m} is not a position on the Earth", position_deg[0], position_deg[1])]
    Origin {
        /// Latitude and longitude.
        position_deg: [f64; 2],
        /// Altitude.
        altitude_m: f64,
    },
    /// The poses of a submap are invalid.
    #[error("placement of submap {}: {row:?} has no valid poses", row.submap)]
    PlacementPose {
        /// The row of the placement.
        row: Box<PlacementRow>,
    },
    /// The origin cannot be projected.
    #[error(transparent)]
    Utm(#[from] UtmError),
    /// A cloud differs from the cloud of the saved state.
    #[error("{}: {got} bytes, the saved state says {expected}; was the file changed after the state was saved?", path.display())]
    Changed {
        /// The cloud.
        path: PathBuf,
        /// Its size, bytes.
        got: u64,
        /// The size in the saved state, bytes.
        expected: u64,
    },
    /// A cloud has no usable coordinates.
    #[error("{}: the cloud has no coordinates x y z of one type", path.display())]
    Coordinates {
        /// The cloud.
        path: PathBuf,
    },
    /// Another program has moved a cloud.
    #[error("{}: the cloud is neither in the frame of the odometry nor in its final frame", path.display())]
    UnknownFrame {
        /// The cloud.
        path: PathBuf,
    },
}

impl DeliveryError {
    /// Whether the cause is a file or the operating system, and not the data.
    pub fn is_of_files(&self) -> bool {
        matches!(self, Self::File { .. } | Self::Ply(_) | Self::Thread(_) | Self::SyncStopped | Self::SyncPanicked)
    }
}
