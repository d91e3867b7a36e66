/// Why a frame or a calibration cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpectralError {
    /// Filter pattern outside what a cell's mask can hold.
    #[error("pattern of {0} px; must be 1 to {max}", max = crate::limits::MAX_PATTERN)]
    Pattern(u32),
    /// Sample depth outside what a u16 can hold.
    #[error("bit depth {0}; must be 1 to 16")]
    BitDepth(u32),
    /// The active area is not inside the image, or has no complete cell.
    #[error(
        "active area x {x} y {y} width {width} height {height} in an image of {image_width}x{image_height} px with a \
         pattern of {pattern} px; must lie inside and hold at least one cell"
    )]
    ActiveArea {
        /// Left column.
        x: u32,
        /// Top row.
        y: u32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Columns of the image.
        image_width: u32,
        /// Rows of the image.
        image_height: u32,
        /// Side of the pattern.
        pattern: u32,
    },
    /// A mosaic with partial cells.
    #[error("mosaic of {width}x{height} px; must have complete cells of {pattern}x{pattern} px")]
    PartialCells {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Side of the pattern.
        pattern: usize,
    },
    /// A buffer of wrong length.
    #[error("{what} of {got} values; must have {expected}")]
    Length {
        /// Which buffer.
        what: &'static str,
        /// Values in it.
        got: usize,
        /// Values that it must have.
        expected: usize,
    },
    /// A reference without frames, or with more than its sums can hold.
    #[error("{what} reference of {n_frames} frames; must have 1 to {max}", max = crate::limits::MAX_FRAMES)]
    Frames {
        /// Dark or white.
        what: &'static str,
        /// Frames in it.
        n_frames: u32,
    },
    /// An exposure time of zero.
    #[error("{what} exposure of {nanos} ns; must be above zero")]
    Exposure {
        /// Of which frame.
        what: &'static str,
        /// As given.
        nanos: u64,
    },
    /// A reflectance that no white reference has.
    #[error("white target with reflectance {0}; must be above 0 and at most 1")]
    WhiteReflectance(f64),
    /// A number of reflectances that does not fit the bands.
    #[error("{n} reflectances of the white panel; must be 1, or one for each of the {n_bands} bands")]
    PanelBands {
        /// As given.
        n: usize,
        /// Of the mosaic.
        n_bands: usize,
    },
    /// A white panel outside of the active area.
    #[error(
        "white panel at {region:?} (left, top, width, height); must lie in the active area {area:?} and hold a pattern"
    )]
    Region {
        /// As given.
        region: [u32; 4],
        /// Whole cells of the active area.
        area: [u64; 4],
    },
    /// A correction matrix of invalid size.
    #[error("correction with {n} {what}; must have 1 to {max}", max = crate::limits::MAX_PATTERN * crate::limits::MAX_PATTERN)]
    CorrectionSize {
        /// Bands or virtual bands.
        what: &'static str,
        /// As given.
        n: usize,
    },
    /// A coefficient that is not finite.
    #[error("row {row} of the correction has the coefficient {value}; must be finite")]
    Coefficient {
        /// From 0.
        row: usize,
        /// As given.
        value: f64,
    },
}
