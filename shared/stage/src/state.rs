//! A stage's state as bytes: versioned and exact.

use run::StateError;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

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

/// Bytes that are saved as one block; serde writes a `Vec<u8>` byte by byte.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoded_floats_have_the_same_bits() {
        let state = (vec![0.1_f64, -0.0, f64::MIN_POSITIVE], 3_u32);
        let bytes = encode_state(2, &state).expect("encodes");
        let back: (Vec<f64>, u32) = decode_state(2, &bytes).expect("decodes");
        assert_eq!(
            back.0.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            state.0.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        );
    }

    #[test]
    fn state_of_another_version_is_refused() {
        let bytes = encode_state(2, &vec![1_u64; 9]).expect("encodes");
        assert_eq!(decode_state::<Vec<u64>>(3, &bytes), Err(StateError::Version { got: 2, expected: 3 }));
        assert_eq!(decode_state::<Vec<u64>>(2, &bytes[..3]), Err(StateError::Foreign(3)));
        assert!(matches!(decode_state::<Vec<u64>>(2, &bytes[..10]), Err(StateError::Content(_))));
    }
}
