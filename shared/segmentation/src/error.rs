//! Errors of model files and of segmentation.

use std::path::PathBuf;

/// A model file or an input that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SegmentationError {
    /// The file cannot be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// Model file.
        path: PathBuf,
        /// Error of the operating system.
        cause: std::io::Error,
    },
    /// The file is larger than any model of this project.
    #[error("{}: {found} bytes; a model file has at most {limit}", path.display())]
    TooLarge {
        /// Model file.
        path: PathBuf,
        /// Size of the file, bytes.
        found: u64,
        /// Largest allowed size, bytes.
        limit: u64,
    },
    /// The file is not safetensors, or it is truncated.
    #[error("{}: not a complete safetensors file: {cause}", path.display())]
    Container {
        /// Model file.
        path: PathBuf,
        /// Error of the safetensors reader.
        cause: safetensors::SafeTensorError,
    },
    /// The metadata key `model` is missing or invalid.
    #[error("{}: metadata key `model`: {reason}", path.display())]
    Card {
        /// Model file.
        path: PathBuf,
        /// Missing or invalid part.
        reason: String,
    },
    /// The architecture is unknown.
    #[error("{}: unknown architecture `{found}`; known are {known}", path.display())]
    Architecture {
        /// Model file.
        path: PathBuf,
        /// Architecture in the file.
        found: String,
        /// Known architectures.
        known: &'static str,
    },
    /// The architecture has another version.
    #[error("{}: {architecture} has version {found}; this program runs version {expected}", path.display())]
    Version {
        /// Model file.
        path: PathBuf,
        /// Architecture in the file.
        architecture: String,
        /// Version in the file.
        found: u32,
        /// Version of this program.
        expected: u32,
    },
    /// A setting of the file is out of range.
    #[error("{}: settings.{key} = {value}; must be between {low} and {high}", path.display())]
    Setting {
        /// Model file.
        path: PathBuf,
        /// Name of the setting.
        key: &'static str,
        /// Value in the file.
        value: f64,
        /// Smallest allowed value.
        low: f64,
        /// Largest allowed value.
        high: f64,
    },
    /// A tensor is missing, or has another shape or type than the architecture needs.
    #[error("{}: tensor `{name}`: {reason}", path.display())]
    Tensor {
        /// Model file.
        path: PathBuf,
        /// Name of the tensor.
        name: String,
        /// The problem, and the expected value.
        reason: String,
    },
    /// The settings of a model contradict each other.
    #[error("model settings: {0}")]
    Settings(String),
    /// A training batch has too few points or clouds.
    #[error("{name}: a training batch needs at least two rows")]
    TooFewRows {
        /// Name of the normalization.
        name: String,
    },
    /// A tensor does not fit the network.
    #[error("tensor `{name}` has shape {found:?}; the network needs {expected:?}")]
    WeightShape {
        /// Name of the tensor.
        name: String,
        /// Shape of the tensor; `None` if there is no such tensor.
        found: Option<Vec<usize>>,
        /// Shape that the network needs.
        expected: Vec<usize>,
    },
    /// An image does not fit the network.
    #[error(
        "input image of {found:?} blocks, rows, columns; the network needs {channels} channels in blocks of 16, and rows and \
         columns that are multiples of {multiple_of:?}"
    )]
    InputSize {
        /// Blocks of 16 channels, rows and columns of the image.
        found: [usize; 3],
        /// Channels of the network's input.
        channels: usize,
        /// Divisors of rows and columns.
        multiple_of: [usize; 2],
    },
    /// The scores of a network do not fit the model.
    #[error("scores of sweep {sweep}: {found} numbers; the model needs {expected:?} channels, rows, columns")]
    Scores {
        /// Number of the sweep in its submap.
        sweep: usize,
        /// Number of scores.
        found: usize,
        /// Channels, rows and columns.
        expected: [usize; 3],
    },
    /// A position of a point is not finite.
    #[error("point {point} is at {position:?} m; coordinates must be numbers within 1e18 m")]
    Position {
        /// Number of the point.
        point: usize,
        /// Its coordinates, m.
        position: [f32; 3],
    },
    /// The columns of a submap differ in length.
    #[error("{column} has {found} rows; the submap has {expected} points")]
    Length {
        /// Name of the column.
        column: &'static str,
        /// Rows of the column.
        found: usize,
        /// Points of the submap.
        expected: usize,
    },
    /// The device is a GPU, and the program cannot use one.
    #[error(
        "device \"cuda\": this program was built without CUDA; build it with `cargo build --release -p infer -p replica_lab --features cuda`, \
         which needs the CUDA toolkit with nvcc, or set device = \"cpu\""
    )]
    BuiltWithoutCuda,
    /// The device is a GPU, and the model is a network on points.
    #[error("device \"cuda\": networks on points run on the CPU only; set device = \"cpu\"")]
    PointsOnGpu,
    /// The GPU cannot be used.
    #[error("device \"cuda\": the first GPU cannot be used: {0}; set device = \"cpu\", or check it with nvidia-smi")]
    NoGpu(String),
    /// A tensor operation failed.
    #[error("tensor operation: {0}")]
    Compute(#[from] candle_core::Error),
    /// A model cannot be encoded.
    #[error("encoding of a model file: {0}")]
    Encode(String),
}
