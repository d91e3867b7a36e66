/// Reason why a frame or a calibration cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpectralError {
    /// The filter pattern exceeds the mask of a cell.
    #[error("pattern of {0} px; must be 1 to {max}", max = crate::limits::MAX_PATTERN)]
    Pattern(u32),
    /// The sample depth does not fit in a u16.
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
    /// The mosaic has partial cells.
    #[error("mosaic of {width}x{height} px; must have complete cells of {pattern}x{pattern} px")]
    PartialCells {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Side of the pattern.
        pattern: usize,
    },
    /// A buffer has the wrong length.
    #[error("{what} of {got} values; must have {expected}")]
    Length {
        /// Name of the buffer.
        what: &'static str,
        /// Number of values in the buffer.
        got: usize,
        /// Expected number of values.
        expected: usize,
    },
    /// A reference has no frames, or more than its sums can hold.
    #[error("{what} reference of {n_frames} frames; must have 1 to {max}", max = crate::limits::MAX_FRAMES)]
    Frames {
        /// Dark or white.
        what: &'static str,
        /// Number of frames.
        n_frames: u32,
    },
    /// An exposure time is zero.
    #[error("{what} exposure of {nanos} ns; must be above zero")]
    Exposure {
        /// The frame with this exposure time.
        what: &'static str,
        /// The given exposure time, ns.
        nanos: u64,
    },
    /// The reflectance is impossible for a white reference.
    #[error("white target with reflectance {0}; must be above 0 and at most 1")]
    WhiteReflectance(f64),
    /// The number of reflectances does not match the bands.
    #[error("{n} reflectances of the white panel; must be 1, or one for each of the {n_bands} bands")]
    PanelBands {
        /// The given number of reflectances.
        n: usize,
        /// Number of bands of the mosaic.
        n_bands: usize,
    },
    /// The white panel is outside the active area.
    #[error(
        "white panel at {region:?} (left, top, width, height); must lie in the active area {area:?} and hold a pattern"
    )]
    Region {
        /// The given region.
        region: [u32; 4],
        /// Whole cells of the active area.
        area: [u64; 4],
    },
    /// The correction matrix has an invalid size.
    #[error("correction with {n} {what}; must have 1 to {max}", max = crate::limits::MAX_PATTERN * crate::limits::MAX_PATTERN)]
    CorrectionSize {
        /// Bands or virtual bands.
        what: &'static str,
        /// The given number.
        n: usize,
    },
    /// A coefficient is not finite.
    #[error("row {row} of the correction has the coefficient {value}; must be finite")]
    Coefficient {
        /// Index of the row, from 0.
        row: usize,
        /// The given coefficient.
        value: f64,
    },
}
