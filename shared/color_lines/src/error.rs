/// Reason why an image or a model cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ColorLinesError {
    /// The image has no pixels or bands, or is too large.
    #[error("image of {}x{} pixels with {n_bands} bands; sides must be 1 to 65535 and at least one band", .size[0], .size[1])]
    Size {
        /// Columns and rows.
        size: [usize; 2],
        /// Bands.
        n_bands: usize,
    },
    /// A buffer has the wrong length.
    #[error("image with {found} values; must have {expected}")]
    Length {
        /// Number of values in the buffer.
        found: usize,
        /// Columns times rows times bands.
        expected: usize,
    },
    /// No pixel is valid, or all are zero.
    #[error("image without a valid pixel above zero; nothing to model")]
    Empty,
    /// A setting is outside its range.
    #[error("{name} = {value}; must be {rule}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// The given value.
        value: f64,
        /// The allowed range.
        rule: &'static str,
    },
    /// The image and the model differ in their number of bands.
    #[error("image with {found} bands; the model has {expected}")]
    Bands {
        /// Number of bands of the image.
        found: usize,
        /// Number of bands of the model.
        expected: usize,
    },
    /// The text is not a model.
    #[error("model: {0}")]
    Json(String),
    /// The parts of a model file contradict each other.
    #[error("model: {0}")]
    Model(&'static str),
}
