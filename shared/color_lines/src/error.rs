/// Why an image or a model cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ColorLinesError {
    /// An image without pixels or bands, or too large.
    #[error("image of {}x{} pixels with {n_bands} bands; sides must be 1 to 65535 and at least one band", .size[0], .size[1])]
    Size {
        /// Columns and rows.
        size: [usize; 2],
        /// Bands.
        n_bands: usize,
    },
    /// A buffer of wrong length.
    #[error("image with {found} values; must have {expected}")]
    Length {
        /// Values in it.
        found: usize,
        /// Columns times rows times bands.
        expected: usize,
    },
    /// No pixel is valid, or all are zero.
    #[error("image without a valid pixel above zero; nothing to model")]
    Empty,
    /// A setting outside of its range.
    #[error("{name} = {value}; must be {rule}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// As given.
        value: f64,
        /// Range.
        rule: &'static str,
    },
    /// An image whose number of bands is not that of the model.
    #[error("image with {found} bands; the model has {expected}")]
    Bands {
        /// Of the image.
        found: usize,
        /// Of the model.
        expected: usize,
    },
    /// A text that is not a model.
    #[error("model: {0}")]
    Json(String),
    /// A model file whose parts contradict each other.
    #[error("model: {0}")]
    Model(&'static str),
}
