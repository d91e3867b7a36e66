//! A stage's state as bytes: versioned, checksummed, exact.

use crate::StepError;
use crate::health::Traffic;
use messages::pod::{FINGERPRINT_START, fingerprint};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

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

/// Encodes a stage's `state` behind its version. Floats keep their bits. The runner adds the checksum.
pub fn encode_state<S: Serialize>(version: u32, state: &S) -> Result<Vec<u8>, StateError> {
    let head = version.to_le_bytes().to_vec();
    postcard::to_extend(state, head).map_err(|error| StateError::Content(error.to_string()))
}

/// The inverse of [`encode_state`].
pub fn decode_state<S: DeserializeOwned>(version: u32, bytes: &[u8]) -> Result<S, StateError> {
    let Some((head, content)) = bytes.split_first_chunk::<4>() else { return Err(StateError::Foreign(bytes.len())) };
    let got = u32::from_le_bytes(*head);
    if got != version {
        return Err(StateError::Version { got, expected: version });
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

/// First bytes of a state file.
const MAGIC: [u8; 8] = *b"REPLICAS";

/// Raised with every change of the layout below or of [`RunnerState`].
const RUNNER_STATE_VERSION: u32 = 2;

/// Bytes before the content of a state file.
///
/// | offset | content |
/// |---|---|
/// | 0 | magic bytes |
/// | 8 | version u32 |
/// | 12 | length of the runner's part u32 |
/// | 16 | checksum u64 of all that follows |
/// | 24 | the runner's part, then the stage's |
const HEAD: usize = 24;

/// A stage's runner at a barrier.
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
}

/// Writes runner and stage so that the file is whole or absent, whatever happens meanwhile.
pub(crate) fn save_state(path: &Path, runner: &RunnerState, stage: &[u8]) -> Result<(), StepError> {
    let runner = postcard::to_stdvec(runner).map_err(|error| StateError::Content(error.to_string()))?;
    let mut head = Vec::with_capacity(HEAD);
    head.extend_from_slice(&MAGIC);
    head.extend_from_slice(&RUNNER_STATE_VERSION.to_le_bytes());
    head.extend_from_slice(&(runner.len() as u32).to_le_bytes());
    head.extend_from_slice(&checksum(&[&runner, stage]).to_le_bytes());
    write_atomically(path, &[&head, &runner, stage])
        .map_err(|error| StepError::Io(format!("{}: {error}", path.display())))
}

/// The inverse of [`save_state`]: the runner's part and the stage's.
pub(crate) fn load_state(path: &Path) -> Result<(RunnerState, Vec<u8>), StepError> {
    let error = |text: String| StepError::Io(format!("{}: {text}", path.display()));
    let bytes = std::fs::read(path).map_err(|cause| error(cause.to_string()))?;
    let (runner, stage) = split_state(&bytes).map_err(|cause| error(cause.to_string()))?;
    let runner = postcard::from_bytes(runner).map_err(|cause| error(cause.to_string()))?;
    Ok((runner, stage.to_vec()))
}

fn split_state(bytes: &[u8]) -> Result<(&[u8], &[u8]), StateError> {
    let foreign = StateError::Foreign(bytes.len());
    let Some((head, content)) = bytes.split_first_chunk::<HEAD>() else { return Err(foreign) };
    let u32_at = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    if !head.starts_with(&MAGIC) {
        return Err(foreign);
    }
    if u32_at(8) != RUNNER_STATE_VERSION {
        return Err(StateError::Version { got: u32_at(8), expected: RUNNER_STATE_VERSION });
    }
    let Some((runner, stage)) = content.split_at_checked(u32_at(12) as usize) else { return Err(foreign) };
    let expected = u64::from(u32_at(16)) | u64::from(u32_at(20)) << 32;
    let got = checksum(&[runner, stage]);
    if got == expected { Ok((runner, stage)) } else { Err(StateError::Checksum { got, expected }) }
}

/// FNV-1a by words of 8 bytes: a state may have a hundred megabytes, and a barrier should not cost a second.
fn checksum(parts: &[&[u8]]) -> u64 {
    parts.iter().fold(FINGERPRINT_START, |state, part| {
        let (words, rest) = part.as_chunks::<8>();
        let state = words.iter().fold(state, |state, word| {
            // The rotation carries the upper bits down, where the next product would otherwise never bring them.
            ((state ^ u64::from_le_bytes(*word)).wrapping_mul(0x0100_0000_01b3)).rotate_left(29)
        });
        fingerprint(fingerprint(state, rest), &(part.len() as u64).to_le_bytes())
    })
}

fn write_atomically(path: &Path, parts: &[&[u8]]) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let unfinished = path.with_extension("unfinished");
    let mut file = std::fs::File::create(&unfinished)?;
    for part in parts {
        file.write_all(part)?;
    }
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
    fn another_version_is_refused() {
        let bytes = encode_state(2, &vec![1_u64; 9]).expect("encodes");
        assert_eq!(decode_state::<Vec<u64>>(3, &bytes), Err(StateError::Version { got: 2, expected: 3 }));
        assert_eq!(decode_state::<Vec<u64>>(2, &bytes[..3]), Err(StateError::Foreign(3)));
        assert!(matches!(decode_state::<Vec<u64>>(2, &bytes[..10]), Err(StateError::Content(_))));
    }

    #[test]
    fn a_state_file_that_is_torn_or_changed_anywhere_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("3/stage.state");
        let runner = RunnerState {
            tick: 7,
            barrier: 3,
            drive_begin: Some(-5),
            barrier_time: None,
            inputs: BTreeMap::new(),
            outputs: BTreeMap::new(),
            counters: BTreeMap::from([("lost".to_owned(), 2)]),
            notes: vec!["a note".to_owned()],
        };
        let stage: Vec<u8> = (0..100).collect();
        save_state(&path, &runner, &stage).expect("saves");
        let (back, stage_back) = load_state(&path).expect("loads");
        assert_eq!((back.tick, back.barrier, back.drive_begin, back.counters), (7, 3, Some(-5), runner.counters));
        assert_eq!(stage_back, stage);
        let bytes = std::fs::read(&path).expect("written");
        for cut in 0..bytes.len() {
            assert!(split_state(&bytes[..cut]).is_err(), "cut to {cut} bytes");
        }
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x40;
            assert!(split_state(&changed).is_err(), "byte {at} changed");
        }
    }
}
