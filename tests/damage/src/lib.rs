//! Damaged bytes for tests of readers: sound files, truncated and changed at seeded random positions.
//!
//! No reader may panic or hang on them. The crate `fuzz_targets` does the same with mutations that extend a corpus.

use random::Random;
use std::path::Path;

/// Truncates, removes, inserts or overwrites bytes.
pub fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.index(4) {
        let at = random.index(bytes.len().max(1));
        match random.index(5) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..(at + random.index(64)).min(bytes.len()))),
            2 => bytes.splice(at..at, (0..random.index(64)).map(|_| 0xff).collect::<Vec<_>>()).for_each(drop),
            _ => {
                for _ in 0..=random.index(8) {
                    // Headers are at the front, so the front is hit more often.
                    let reach = if random.index(2) == 0 { 200 } else { bytes.len() };
                    let at = random.index(reach.min(bytes.len()).max(1));
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte = random.bits() as u8;
                    }
                }
            }
        }
    }
    bytes
}

/// Calls `parse` with damaged copies of the bytes.
pub fn attack(seed: u64, rounds: usize, bytes: &[u8], mut parse: impl FnMut(&[u8])) {
    let mut random = Random::new(seed);
    for _ in 0..rounds {
        parse(&damaged(bytes, &mut random));
    }
}

/// A sound file: the first seed of a fuzz target.
///
/// # Panics
/// If there is no such target.
pub fn seed(target: &str) -> Vec<u8> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz_targets/corpus");
    std::fs::read(corpus.join(target).join("seed_0")).expect("is there")
}
