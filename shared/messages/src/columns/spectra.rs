//! Topic `spectra`: the spectra of the points that a mosaic camera saw.

use super::COLUMN_QUEUE;
use crate::pod::cast_slice;
use crate::{Message, pod};

/// Bands of all mosaic cameras together: 25 of HS02 and 16 of HS03, and room for a third.
pub const MAX_BANDS: usize = 64;

/// Index word of a point without a spectrum.
pub const NO_SPECTRUM: u32 = u32::MAX;

pod! {
    /// The bands of the spectra.
    pub struct SpectraHeader {
        /// Points of the submap.
        pub n_points: u32,
        /// Points with a spectrum.
        pub n_spectra: u32,
        /// Bands of one spectrum.
        pub n_bands: u32,
        /// Zero.
        pub reserved: u32,
        /// Center of each band in nm.
        pub wavelengths_nm: [f32; MAX_BANDS],
        /// Mosaic camera of each band.
        pub cameras: [u8; MAX_BANDS],
    }
}

/// Spectra of the points that a mosaic camera saw. Most points have no spectrum, so the column is an index and a table.
/// Rows are 4-byte words: `n_points` indices into the table ([`NO_SPECTRUM`] = unseen), then per spectrum
/// two words of validity (bit b of the 64: band b was measured) and `n_bands` reflectances (f32). See [`SpectraView`].
pub struct SpectraTopic;
impl Message for SpectraTopic {
    const TOPIC: &'static str = "spectra";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    // An index for every point, and 43 words of spectrum for a third of the points of the largest submap.
    const MAX_ROWS: usize = 1 << 27;
    type Header = SpectraHeader;
    type Row = u32;
}

/// A spectra column's payload, read in place.
#[derive(Clone, Copy)]
pub struct SpectraView<'a> {
    indices: &'a [u32],
    table: &'a [u32],
    n_bands: usize,
}

impl<'a> SpectraView<'a> {
    /// `None` if the number of rows does not fit the header.
    pub fn new(header: &SpectraHeader, rows: &'a [u32]) -> Option<Self> {
        let n_bands = header.n_bands as usize;
        let n_points = header.n_points as usize;
        if n_bands > MAX_BANDS || rows.len() != n_points + header.n_spectra as usize * (n_bands + 2) {
            return None;
        }
        let (indices, table) = rows.split_at(n_points);
        Some(Self { indices, table, n_bands })
    }
    /// Validity bits and reflectances of a point, `None` if no mosaic camera saw it.
    pub fn spectrum(&self, point_idx: usize) -> Option<(u64, &'a [f32])> {
        let index = self.indices[point_idx];
        if index == NO_SPECTRUM {
            return None;
        }
        let words = self.table.get(index as usize * (self.n_bands + 2)..)?.get(..self.n_bands + 2)?;
        Some((u64::from(words[0]) | u64::from(words[1]) << 32, cast_slice(&words[2..])))
    }
}
