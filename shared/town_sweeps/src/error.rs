//! Errors of this crate.

use simulation::{SimulationError, Town};

/// Reason why there are no sweeps.
#[derive(Debug, thiserror::Error)]
pub enum TownSweepsError {
    /// The drive cannot be simulated.
    #[error("town of seed {seed}: {cause}")]
    Town {
        /// Seed of the drive.
        seed: u64,
        /// The reason.
        cause: SimulationError,
    },
    /// The drive is shorter than a submap.
    #[error("{n_sweeps} sweeps, {stride} revolutions apart, are longer than the drive of {seconds} s")]
    TooShort {
        /// Number of sweeps of a submap.
        n_sweeps: usize,
        /// Revolutions from one sweep to the next.
        stride: u64,
        /// Length of the drive, s.
        seconds: f64,
    },
    /// No kind of town has this name.
    #[error("unknown kind of town {name:?}, must be one of {}", settings::words_of::<Town>())]
    UnknownTown {
        /// The name.
        name: String,
    },
    /// The references of a mosaic camera or its frames cannot be used.
    #[error(transparent)]
    Spectral(#[from] spectral::SpectralError),
    /// A cube has no regions.
    #[error(transparent)]
    ColorLines(#[from] color_lines::ColorLinesError),
    /// The mosaic cameras have too many bands.
    #[error(transparent)]
    Bands(#[from] coloring::TooManyBands),
}
