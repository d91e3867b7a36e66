//! Topic `cube`: calibrated reflectance of one mosaic exposure.

use crate::{Message, pod, pod::cast_slice};

/// Bands of the largest cube: the 5x5 mosaic has 25; the next power of two leaves room for virtual bands.
pub const MAX_CUBE_BANDS: usize = 32;

pod! {
    /// Data of the whole cube.
    pub struct CubeHeader {
        /// Index into the rig's mosaic cameras.
        pub camera: u32,
        /// Columns of the cube.
        pub width: u32,
        /// Rows of the cube.
        pub height: u32,
        /// Bands in use.
        pub n_bands: u32,
        /// Side of a cell in raw pixels: the side of the mosaic's pattern, or 1 if the cube is demosaiced; cell (c, r)
        /// covers raw columns `x0 + c*pattern ..`.
        pub pattern: u32,
        /// Bit b: band b is usable in some cells.
        pub valid_bands: u32,
        /// Left column of the active area in the raw image.
        pub x0: u32,
        /// Top row of the active area in the raw image.
        pub y0: u32,
        /// Exposure time in ns; the stamp is its middle.
        pub exposure_nanos: u64,
        /// Center of each band in nm, in band order; unused entries are zero.
        pub wavelengths_nm: [f32; MAX_CUBE_BANDS],
    }
}

/// A reflectance cube. Rows are 4-byte words: `n_bands * height * width` reflectances (f32, band-sequential), then
/// `height * width` masks (bit b set: band b was measured here, neither saturated nor dead). With `[calibrate] color_lines`,
/// `height * width` numbers of regions follow (0 = none). See [`CubeView`].
pub struct CubeTopic;
impl Message for CubeTopic {
    const TOPIC: &'static str = "cube";
    const VERSION: u32 = 1;
    // As for `image`, with two cameras. 9 MB each with 25 bands, 72 MB if all wait.
    const QUEUE: usize = 8;
    // As for `image`, with two cameras.
    const BORROWED: usize = 32;
    // 2045 x 1085 px with 25 bands, a mask and a region, demosaiced: 59.9 million. Unwritten rows take no memory.
    const MAX_ROWS: usize = 1 << 26;
    type Header = CubeHeader;
    type Row = u32;
}

/// A cube's payload, read in place.
#[derive(Clone, Copy)]
pub struct CubeView<'a> {
    n_cells: usize,
    reflectances: &'a [f32],
    masks: &'a [u32],
    regions: Option<&'a [u32]>,
}

impl<'a> CubeView<'a> {
    /// `None` if the number of rows does not fit the header.
    pub fn new(header: &CubeHeader, rows: &'a [u32]) -> Option<Self> {
        let n_cells = (header.width as usize).checked_mul(header.height as usize)?;
        let n_bands = header.n_bands as usize;
        let n_planes = |n: usize| Some(rows.len()) == n_cells.checked_mul(n_bands + n);
        if n_bands > MAX_CUBE_BANDS || !(n_planes(1) || n_planes(2)) {
            return None;
        }
        let (reflectances, rest) = rows.split_at(n_bands * n_cells);
        let (masks, regions) = rest.split_at(n_cells);
        let regions = (!regions.is_empty()).then_some(regions);
        Some(Self { n_cells, reflectances: cast_slice(reflectances), masks, regions })
    }
    /// Reflectances of one band, row-major.
    pub fn band(&self, band: usize) -> &'a [f32] {
        &self.reflectances[band * self.n_cells..][..self.n_cells]
    }
    /// Measured bands, per cell, row-major.
    pub fn masks(&self) -> &'a [u32] {
        self.masks
    }
    /// The region of each cell, row-major; 0 = none. `None` for a cube without regions.
    pub fn regions(&self) -> Option<&'a [u32]> {
        self.regions
    }
}
