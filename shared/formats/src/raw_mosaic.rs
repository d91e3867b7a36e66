//! Raw frames of mosaic cameras from PGM or TIFF files. A TIFF with one sample per band, as written by camera programs
//! after binning, is converted back to a mosaic.

use crate::pgm::{Pgm, PgmError};
use crate::tiff::{Tiff, TiffError};
use files::regular_file;
use ndarray::ArrayView4;
use std::path::{Path, PathBuf};

/// Error of a file that is not a raw frame.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {fault}", path = path.display())]
pub struct RawMosaicError {
    /// The file.
    pub path: PathBuf,
    /// Fault of the file.
    pub fault: RawMosaicFault,
}

/// Fault of a raw frame.
#[derive(Debug, thiserror::Error)]
pub enum RawMosaicFault {
    /// The operating system reported an error.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The file is neither PGM nor TIFF.
    #[error("the file begins with bytes {0:02x?}; expected P5 (binary PGM), or II or MM (TIFF)")]
    Magic(Vec<u8>),
    /// The PGM file is invalid.
    #[error(transparent)]
    Pgm(#[from] PgmError),
    /// The TIFF file is invalid or not supported.
    #[error(transparent)]
    Tiff(#[from] TiffError),
    /// The number of bands does not fit a square pattern.
    #[error("{0} samples per pixel; expected 1, or one for each cell of a square pattern (4, 9, 16, 25, …)")]
    Bands(usize),
}

/// A raw frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawMosaic {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bits of the largest value that a sample of the file may have, 1 to 16. The camera may use fewer.
    pub bit_depth: u32,
    /// Exposure time, ns, if the file has it.
    pub exposure_nanos: Option<u64>,
    /// Row-major from the top left.
    pub samples: Vec<u16>,
}

impl RawMosaic {
    /// Reads a file. Its first bytes determine the format.
    pub fn read(path: &Path) -> Result<Self, RawMosaicError> {
        let error = |fault: RawMosaicFault| RawMosaicError { path: path.to_owned(), fault };
        let bytes = regular_file::read(path).map_err(|cause| error(cause.into()))?;
        Self::parse(&bytes).map_err(error)
    }

    /// Reads the bytes of a file.
    pub fn parse(bytes: &[u8]) -> Result<Self, RawMosaicFault> {
        match bytes.get(..2) {
            Some(b"P5") => {
                let pgm = Pgm::parse(bytes)?;
                let width = pgm.width;
                let height = pgm.height;
                let bit_depth = u32::BITS - pgm.max.leading_zeros();
                Ok(Self { width, height, bit_depth, exposure_nanos: None, samples: pgm.samples() })
            }
            Some(b"II" | b"MM") => Self::from_tiff(Tiff::parse(bytes)?),
            _ => Err(RawMosaicFault::Magic(bytes[..bytes.len().min(2)].to_vec())),
        }
    }

    fn from_tiff(tiff: Tiff) -> Result<Self, RawMosaicFault> {
        let Tiff { width, height, n_bands, bit_depth, exposure_nanos, samples } = tiff;
        let pattern = n_bands.isqrt();
        if pattern * pattern != n_bands {
            return Err(RawMosaicFault::Bands(n_bands as usize));
        }
        let samples = if n_bands == 1 {
            samples
        } else {
            mosaic_from_cube(&samples, [height, width, pattern].map(|n| n as usize))
        };
        Ok(Self { width: width * pattern, height: height * pattern, bit_depth, exposure_nanos, samples })
    }
}

/// The mosaic of a binned cube. The bands of a pixel are interleaved, in the order of the pattern.
fn mosaic_from_cube(cube: &[u16], [rows, columns, pattern]: [usize; 3]) -> Vec<u16> {
    let cube = ArrayView4::from_shape((rows, columns, pattern, pattern), cube).expect("one sample per pixel and band");
    let mut mosaic = Vec::with_capacity(cube.len());
    // The rows of a cell become rows of the mosaic, its columns become columns.
    // `iter` keeps the order of the axes; `for_each` visits the samples in the order of memory.
    mosaic.extend(cube.permuted_axes([0, 2, 1, 3]).iter());
    mosaic
}
