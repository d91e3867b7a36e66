//! Model files: safetensors with one metadata key `model`, a JSON object
//! `{"architecture": …, "version": …, "settings": {…}}`.
//!
//! A file can contain several models: its settings then have their cards, and the tensors of the first are named `0.…`.
//!
//! There is one key instead of three because safetensors keeps its metadata in a hash map: with one key, equal models
//! give equal bytes.

use crate::SegmentationError;
use candle_core::{DType, Device, Tensor};
use files::regular_file;
use messages::pod::{FINGERPRINT_START, fingerprint};
use safetensors::SafeTensors;
use safetensors::tensor::Metadata;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::{BTreeMap, HashMap};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Size limit of a model file, bytes: a hundred times the networks that run on a CPU alongside the other stages.
pub const MAX_MODEL_BYTES: u64 = 1 << 30;

/// Metadata key of the model card.
const CARD_KEY: &str = "model";

/// Identification of a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelCard {
    /// Name of the architecture.
    pub architecture: String,
    /// Version of the architecture. It is incremented when the same file would give other classes.
    pub version: u32,
    /// 64-bit FNV-1a of the whole file.
    pub digest: u64,
}

/// The card in its stored form.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CardText {
    pub architecture: String,
    pub version: u32,
    pub settings: serde_json::Value,
}

/// A model file whose container and card are valid.
pub struct ModelFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Architecture, version and digest.
    pub card: ModelCard,
    settings: serde_json::Value,
    /// Common prefix of its tensor names.
    prefix: String,
    container: Arc<Container>,
}

/// A safetensors file, read once: parsing its header for each tensor would dominate the loading time.
struct Container {
    metadata: Metadata,
    data_start: usize,
    bytes: Vec<u8>,
}

/// Size of the length field before the header, bytes.
const LENGTH_BYTES: usize = 8;

impl ModelFile {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, SegmentationError> {
        let bytes = read_bounded(path)?;
        let container = |cause| SegmentationError::Container { path: path.into(), cause };
        // This also checks the extents of the tensors: a truncated file fails here.
        SafeTensors::deserialize(&bytes).map_err(container)?;
        let (header_len, metadata) = SafeTensors::read_metadata(&bytes).map_err(container)?;
        let card = |reason: String| SegmentationError::Card { path: path.into(), reason };
        let text = metadata.metadata().as_ref().and_then(|metadata| metadata.get(CARD_KEY));
        let text = text.ok_or_else(|| card("missing; it names the architecture of the model".to_owned()))?;
        let text: CardText = serde_json::from_str(text).map_err(|error| card(error.to_string()))?;
        let digest = fingerprint(FINGERPRINT_START, &bytes);
        let card = ModelCard { architecture: text.architecture, version: text.version, digest };
        let container = Arc::new(Container { metadata, data_start: LENGTH_BYTES + header_len, bytes });
        Ok(Self { path: path.into(), card, settings: text.settings, prefix: String::new(), container })
    }

    /// One of the models that the file contains, with the digest of the file.
    pub(crate) fn part(&self, number: usize, text: CardText) -> Self {
        let CardText { architecture, version, settings } = text;
        let card = ModelCard { architecture, version, digest: self.card.digest };
        let prefix = format!("{}{}", self.prefix, prefix_of(number));
        Self { path: self.path.clone(), card, settings, prefix, container: self.container.clone() }
    }

    /// The card in its stored form.
    pub(crate) fn card_text(&self) -> CardText {
        let ModelCard { architecture, version, .. } = self.card.clone();
        CardText { architecture, version, settings: self.settings.clone() }
    }

    /// All tensors, with the names that they have in a part.
    pub(crate) fn tensors_of_part(&self, number: usize) -> Result<BTreeMap<String, Tensor>, SegmentationError> {
        let names = self.container.metadata.tensors().into_keys();
        names.map(|name| Ok((prefix_of(number) + &name, self.load(&name)?))).collect()
    }

    /// Returns an error if the file has another version of its architecture.
    pub fn expect_version(&self, expected: u32) -> Result<(), SegmentationError> {
        if self.card.version == expected {
            return Ok(());
        }
        let architecture = self.card.architecture.clone();
        let found = self.card.version;
        Err(SegmentationError::Version { path: self.path.clone(), architecture, found, expected })
    }

    /// Settings of the model.
    pub fn settings<S: DeserializeOwned>(&self) -> Result<S, SegmentationError> {
        S::deserialize(&self.settings)
            .map_err(|error| SegmentationError::Card { path: self.path.clone(), reason: format!("settings: {error}") })
    }

    /// The error for an invalid tensor.
    pub(crate) fn bad_tensor(&self, name: &str, reason: String) -> SegmentationError {
        SegmentationError::Tensor { path: self.path.clone(), name: format!("{}{name}", self.prefix), reason }
    }

    /// The error for an unknown architecture.
    pub(crate) fn unknown_architecture(&self) -> SegmentationError {
        let known = "fused, ground_quasi_flat, points, spherical";
        SegmentationError::Architecture { path: self.path.clone(), found: self.card.architecture.clone(), known }
    }

    /// The finite f32 values of a tensor of this shape.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, SegmentationError> {
        let tensor = self.load(name)?;
        if tensor.dims() != shape {
            return Err(self.bad_tensor(name, format!("has shape {:?}, expected {shape:?}", tensor.dims())));
        }
        self.finite(name, &tensor)
    }

    fn load(&self, name: &str) -> Result<Tensor, SegmentationError> {
        let Container { metadata, data_start, bytes } = &*self.container;
        let info = metadata.info(&format!("{}{name}", self.prefix));
        let info = info.ok_or_else(|| self.bad_tensor(name, "is missing".to_owned()))?;
        let (start, end) = info.data_offsets;
        DType::try_from(info.dtype)
            .and_then(|dtype| {
                let data = &bytes[data_start + start..data_start + end];
                Tensor::from_raw_buffer(data, dtype, &info.shape, &Device::Cpu)
            })
            .map_err(|error| self.bad_tensor(name, error.to_string()))
    }

    fn finite(&self, name: &str, tensor: &Tensor) -> Result<Vec<f32>, SegmentationError> {
        if tensor.dtype() != DType::F32 {
            return Err(self.bad_tensor(name, format!("has type {:?}, expected F32", tensor.dtype())));
        }
        let values = tensor.flatten_all()?.to_vec1::<f32>()?;
        match values.iter().position(|value| !value.is_finite()) {
            Some(idx) => {
                Err(self.bad_tensor(name, format!("element {idx} is {}, expected a finite number", values[idx])))
            }
            None => Ok(values),
        }
    }

    /// A vector of finite f32 values with a length in `len`.
    pub(crate) fn vector(
        &self,
        name: &str,
        len: std::ops::RangeInclusive<usize>,
    ) -> Result<Vec<f32>, SegmentationError> {
        let tensor = self.load(name)?;
        let [n] = tensor.dims() else {
            return Err(self.bad_tensor(name, format!("has shape {:?}, expected one dimension", tensor.dims())));
        };
        if !len.contains(n) {
            let rule = format!("has {n} elements, expected {} to {}", len.start(), len.end());
            return Err(self.bad_tensor(name, rule));
        }
        self.finite(name, &tensor)
    }
}

/// Prefix of the tensor names of a part.
fn prefix_of(number: usize) -> String {
    format!("{number}.")
}

#[allow(clippy::disallowed_methods, reason = "a stage loads its model before its first step")]
fn read_bounded(path: &Path) -> Result<Vec<u8>, SegmentationError> {
    let io = |cause| SegmentationError::Io { path: path.into(), cause };
    let file = regular_file::open(path).map_err(io)?;
    let found = file.metadata().map_err(io)?.len();
    if found > MAX_MODEL_BYTES {
        return Err(SegmentationError::TooLarge { path: path.into(), found, limit: MAX_MODEL_BYTES });
    }
    let mut bytes = Vec::with_capacity(found as usize);
    file.take(MAX_MODEL_BYTES).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// The bytes of a model file. Equal models give equal bytes.
pub fn encode_model(
    architecture: &str,
    version: u32,
    settings: &impl Serialize,
    tensors: BTreeMap<&str, Tensor>,
) -> Result<Vec<u8>, SegmentationError> {
    let wrong = SegmentationError::Encode;
    let settings = serde_json::to_value(settings).map_err(|error| wrong(error.to_string()))?;
    let card = CardText { architecture: architecture.to_owned(), version, settings };
    let card = serde_json::to_string(&card).map_err(|error| wrong(error.to_string()))?;
    let metadata = HashMap::from([(CARD_KEY.to_owned(), card)]);
    safetensors::serialize(tensors, Some(metadata)).map_err(|error| wrong(error.to_string()))
}
