//! A raw frame of a mosaic camera out of a file: PGM, or TIFF of one sample a pixel; a TIFF of one sample for each band, as
//! cameras' programs write it after binning, is put back into its mosaic.

use crate::pgm::Pgm;
use crate::tiff::Tiff;
use std::path::{Path, PathBuf};

/// Why a file is no raw frame.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {rule}", path = path.display())]
pub struct RawMosaicError {
    /// The file.
    pub path: PathBuf,
    /// What was found and what must be there.
    pub rule: String,
}

/// A frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawMosaic {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bits that hold the largest value that the file's samples may have, 1 to 16. The camera may use fewer.
    pub bit_depth: u32,
    /// If the file tells, ns.
    pub exposure_nanos: Option<u64>,
    /// Row-major from the top left.
    pub samples: Vec<u16>,
}

impl RawMosaic {
    /// Reads a file whose first bytes say which kind it is.
    pub fn read(path: &Path) -> Result<Self, RawMosaicError> {
        let refuse = |rule: String| RawMosaicError { path: path.to_owned(), rule };
        let bytes = std::fs::read(path).map_err(|error| refuse(error.to_string()))?;
        Self::parse(&bytes).map_err(refuse)
    }

    /// The same out of a file's bytes. The error is the rule that they break.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        match bytes.get(..2) {
            Some(b"P5") => {
                let pgm = Pgm::parse(bytes).map_err(|error| error.to_string())?;
                let (width, height, bit_depth) = (pgm.width, pgm.height, u32::BITS - pgm.max.leading_zeros());
                Ok(Self { width, height, bit_depth, exposure_nanos: None, samples: pgm.samples() })
            }
            Some(b"II" | b"MM") => Self::of_tiff(Tiff::parse(bytes).map_err(|error| error.to_string())?),
            _ => Err("must begin with P5 (binary PGM), or with II or MM (TIFF)".to_owned()),
        }
    }

    fn of_tiff(tiff: Tiff) -> Result<Self, String> {
        let Tiff { width, height, n_bands, bit_depth, exposure_nanos, samples } = tiff;
        let pattern = n_bands.isqrt();
        if pattern * pattern != n_bands {
            return Err(format!("{n_bands} samples a pixel; must be one, or one for each cell of a square pattern"));
        }
        let samples = if n_bands == 1 { samples } else { mosaic_of(&samples, width as usize, pattern as usize) };
        Ok(Self { width: width * pattern, height: height * pattern, bit_depth, exposure_nanos, samples })
    }
}

/// The mosaic of a binned cube whose bands stand side by side in the pattern's order.
fn mosaic_of(cube: &[u16], columns: usize, pattern: usize) -> Vec<u16> {
    let mut mosaic = Vec::with_capacity(cube.len());
    for cells in cube.chunks_exact(columns * pattern * pattern) {
        for dy in 0..pattern {
            let cells = cells.chunks_exact(pattern * pattern);
            mosaic.extend(cells.flat_map(|bands| &bands[dy * pattern..][..pattern]));
        }
    }
    mosaic
}
