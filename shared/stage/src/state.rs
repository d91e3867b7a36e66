//! A stage's state as bytes: versioned, checksummed, exact.

use crate::StepError;
use crate::health::Traffic;
use messages::pod::{FINGERPRINT_START, fingerprint};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// First bytes of a saved state.
const MAGIC: [u8; 8] = *b"REPLICAS";

/// Why a saved state cannot be taken up.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum StateError {
    /// Too short or without the magic bytes.
    #[error("not a saved state: {0} bytes")]
    Foreign(usize),
    /// Written by another version of the stage.
    #[error("saved state has version {got}, expected {expected}")]
    Version {
        /// In the file.
        got: u32,
        /// Of this program.
        expected: u32,
    },
    /// Torn or changed.
    #[error("saved state has checksum {got:016x}, expected {expected:016x}")]
    Checksum {
        /// Of the bytes.
        got: u64,
        /// In the file.
        expected: u64,
    },
    /// The content does not decode.
    #[error("saved state does not decode: {0}")]
    Content(String),
}

impl From<StateError> for StepError {
    fn from(error: StateError) -> Self {
        StepError::data(error)
    }
}

/// Encodes `state`: magic, version, checksum, content. Floats keep their bits.
pub fn encode_state<S: Serialize>(version: u32, state: &S) -> Result<Vec<u8>, StateError> {
    let content = postcard::to_stdvec(state).map_err(|error| StateError::Content(error.to_string()))?;
    let mut bytes = Vec::with_capacity(content.len() + 20);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&version.to_le_bytes());
    bytes.extend_from_slice(&fingerprint(FINGERPRINT_START, &content).to_le_bytes());
    bytes.extend_from_slice(&content);
    Ok(bytes)
}

/// The inverse of [`encode_state`].
pub fn decode_state<S: DeserializeOwned>(version: u32, bytes: &[u8]) -> Result<S, StateError> {
    let foreign = StateError::Foreign(bytes.len());
    let Some((head, content)) = bytes.split_first_chunk::<20>() else { return Err(foreign) };
    let (magic, rest) = head.split_at(8);
    if magic != MAGIC {
        return Err(foreign);
    }
    let got_version = u32::from_le_bytes([rest[0], rest[1], rest[2], rest[3]]);
    if got_version != version {
        return Err(StateError::Version { got: got_version, expected: version });
    }
    let expected = u64::from_le_bytes([rest[4], rest[5], rest[6], rest[7], rest[8], rest[9], rest[10], rest[11]]);
    let got = fingerprint(FINGERPRINT_START, content);
    if got != expected {
        return Err(StateError::Checksum { got, expected });
    }
    postcard::from_bytes(content).map_err(|error| StateError::Content(error.to_string()))
}

/// Bytes that are saved as one block; a `Vec<u8>` would go through one call per byte.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bytes(pub Vec<u8>);

impl std::ops::Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}

impl Serialize for Bytes {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de> Deserialize<'de> for Bytes {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Block;
        impl serde::de::Visitor<'_> for Block {
            type Value = Bytes;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a block of bytes")
            }
            fn visit_bytes<E: serde::de::Error>(self, bytes: &[u8]) -> Result<Bytes, E> {
                Ok(Bytes(bytes.to_vec()))
            }
        }
        deserializer.deserialize_bytes(Block)
    }
}

/// Version of [`RunnerState`].
const RUNNER_STATE_VERSION: u32 = 1;

/// A stage and its runner at a barrier.
#[derive(Serialize, Deserialize)]
pub(crate) struct RunnerState {
    pub(crate) tick: u64,
    pub(crate) barrier: u64,
    pub(crate) drive_begin: Option<i64>,
    pub(crate) barrier_time: Option<i64>,
    pub(crate) inputs: BTreeMap<String, Traffic>,
    pub(crate) outputs: BTreeMap<String, Traffic>,
    pub(crate) counters: BTreeMap<String, u64>,
    pub(crate) notes: Vec<String>,
    pub(crate) stage: Bytes,
}

/// Writes the state so that the file is whole or absent, whatever happens meanwhile.
pub(crate) fn save_state(path: &Path, state: &RunnerState) -> Result<(), StepError> {
    let bytes = encode_state(RUNNER_STATE_VERSION, state)?;
    write_atomically(path, &bytes).map_err(|error| StepError::Io(format!("{}: {error}", path.display())))
}

pub(crate) fn load_state(path: &Path) -> Result<RunnerState, StepError> {
    let error = |text: String| StepError::Io(format!("{}: {text}", path.display()));
    let bytes = std::fs::read(path).map_err(|cause| error(cause.to_string()))?;
    decode_state(RUNNER_STATE_VERSION, &bytes).map_err(|cause| error(cause.to_string()))
}

fn write_atomically(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let unfinished = path.with_extension("unfinished");
    let mut file = std::fs::File::create(&unfinished)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    std::fs::rename(&unfinished, path)?;
    // The new name itself must be on disk too.
    std::fs::File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_come_back_to_the_bit() {
        let state = (vec![0.1_f64, -0.0, f64::MIN_POSITIVE], 3_u32);
        let bytes = encode_state(2, &state).expect("encodes");
        let back: (Vec<f64>, u32) = decode_state(2, &bytes).expect("decodes");
        assert_eq!(
            back.0.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            state.0.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        );
    }

    #[test]
    fn torn_foreign_and_old_states_are_refused() {
        let bytes = encode_state(2, &vec![1_u64; 9]).expect("encodes");
        assert!(matches!(decode_state::<Vec<u64>>(2, &bytes[..bytes.len() - 1]), Err(StateError::Checksum { .. })));
        assert_eq!(decode_state::<Vec<u64>>(2, &bytes[..10]), Err(StateError::Foreign(10)));
        assert_eq!(decode_state::<Vec<u64>>(3, &bytes), Err(StateError::Version { got: 2, expected: 3 }));
    }
}
