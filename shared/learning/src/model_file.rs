//! A model file: safetensors, with one metadata key `model` that holds a JSON object
//! `{"architecture": …, "version": …, "settings": {…}}`.
//!
//! One key and not three, because safetensors keeps its metadata in a hash map: with one key the same model gives the
//! same bytes.

use crate::LearningError;
use candle_core::safetensors::SliceSafetensors;
use candle_core::{DType, Device, Tensor};
use messages::pod::{FINGERPRINT_START, fingerprint};
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::{BTreeMap, HashMap};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest model file that is read, bytes: a hundred times the networks that run on a CPU beside the other stages.
pub const MAX_MODEL_BYTES: u64 = 1 << 30;

/// Metadata key of the card.
const CARD_KEY: &str = "model";

/// What a model says about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelCard {
    /// Kind of model.
    pub architecture: String,
    /// Of the architecture: raised when the same file would give other classes.
    pub version: u32,
    /// 64-bit FNV-1a of the whole file.
    pub digest: u64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CardText {
    architecture: String,
    version: u32,
    settings: serde_json::Value,
}

/// A model file whose container and card have been read.
pub(crate) struct ModelFile {
    pub(crate) path: PathBuf,
    pub(crate) card: ModelCard,
    settings: serde_json::Value,
    bytes: Vec<u8>,
}

impl ModelFile {
    pub(crate) fn read(path: &Path) -> Result<Self, LearningError> {
        let bytes = read_bounded(path)?;
        let container = |reason: String| LearningError::Container { path: path.into(), reason };
        let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(|error| container(error.to_string()))?;
        // Reads the tensors' extents too: a file that was cut off ends here.
        SafeTensors::deserialize(&bytes).map_err(|error| container(error.to_string()))?;
        let card = |reason: String| LearningError::Card { path: path.into(), reason };
        let text = metadata.metadata().as_ref().and_then(|metadata| metadata.get(CARD_KEY));
        let text = text.ok_or_else(|| card("is absent, so nothing says what kind of model this is".to_owned()))?;
        let text: CardText = serde_json::from_str(text).map_err(|error| card(error.to_string()))?;
        let digest = fingerprint(FINGERPRINT_START, &bytes);
        let card = ModelCard { architecture: text.architecture, version: text.version, digest };
        Ok(Self { path: path.into(), card, settings: text.settings, bytes })
    }

    /// Refuses a file of another version of its architecture.
    pub(crate) fn expect_version(&self, expected: u32) -> Result<(), LearningError> {
        if self.card.version == expected {
            return Ok(());
        }
        let (architecture, got) = (self.card.architecture.clone(), self.card.version);
        Err(LearningError::Version { path: self.path.clone(), architecture, got, expected })
    }

    pub(crate) fn settings<S: DeserializeOwned>(&self) -> Result<S, LearningError> {
        S::deserialize(&self.settings)
            .map_err(|error| LearningError::Card { path: self.path.clone(), reason: format!("settings: {error}") })
    }

    pub(crate) fn bad_tensor(&self, name: &str, reason: String) -> LearningError {
        LearningError::Tensor { path: self.path.clone(), name: name.to_owned(), reason }
    }

    /// The finite f32 of a tensor of this shape.
    pub(crate) fn tensor(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, LearningError> {
        let tensor = self.load(name)?;
        if tensor.dims() != shape {
            return Err(self.bad_tensor(name, format!("has shape {:?}, expected {shape:?}", tensor.dims())));
        }
        self.finite(name, &tensor)
    }

    fn load(&self, name: &str) -> Result<Tensor, LearningError> {
        SliceSafetensors::new(&self.bytes)
            .and_then(|tensors| tensors.load(name, &Device::Cpu))
            .map_err(|error| self.bad_tensor(name, error.to_string()))
    }

    fn finite(&self, name: &str, tensor: &Tensor) -> Result<Vec<f32>, LearningError> {
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

    /// A vector of `len` finite f32.
    pub(crate) fn vector(
        &self,
        name: &'static str,
        len: std::ops::RangeInclusive<usize>,
    ) -> Result<Vec<f32>, LearningError> {
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

fn read_bounded(path: &Path) -> Result<Vec<u8>, LearningError> {
    let io = |cause| LearningError::Io { path: path.into(), cause };
    let file = std::fs::File::open(path).map_err(io)?;
    let got = file.metadata().map_err(io)?.len();
    if got > MAX_MODEL_BYTES {
        return Err(LearningError::TooLarge { path: path.into(), got, limit: MAX_MODEL_BYTES });
    }
    let mut bytes = Vec::with_capacity(got as usize);
    file.take(MAX_MODEL_BYTES).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// The bytes of a model file. The same model gives the same bytes.
pub(crate) fn encode(
    architecture: &str,
    version: u32,
    settings: &impl Serialize,
    tensors: BTreeMap<&str, Tensor>,
) -> Result<Vec<u8>, LearningError> {
    let wrong = |error: String| LearningError::Compute(candle_core::Error::Msg(error));
    let settings = serde_json::to_value(settings).map_err(|error| wrong(error.to_string()))?;
    let card = CardText { architecture: architecture.to_owned(), version, settings };
    let card = serde_json::to_string(&card).map_err(|error| wrong(error.to_string()))?;
    let metadata = HashMap::from([(CARD_KEY.to_owned(), card)]);
    safetensors::serialize(tensors, Some(metadata)).map_err(|error| wrong(error.to_string()))
}
