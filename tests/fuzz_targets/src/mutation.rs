//! Seeded mutations of a corpus.

use random::Random;
use std::io;
use std::path::Path;

/// Longest input, bytes.
const MAX_BYTES: usize = 64 << 10;
/// Numbers at the limits of types.
const EDGES: [u64; 12] = [
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];
/// Values at the limits of text formats.
const WORDS: [&str; 12] = [
    "0",
    "-1",
    "4294967296",
    "18446744073709551616",
    "99999999999999999999999",
    "1e308",
    "-1e-400",
    "nan",
    "inf",
    "",
    "\u{fffd}",
    "[[[[[[[[",
];

/// The files of a target's corpus in the order of their names.
pub fn corpus(target: &str) -> io::Result<Vec<Vec<u8>>> {
    Ok(corpus_files(target)?.into_iter().map(|(_, bytes)| bytes).collect())
}

/// The files of a target's corpus with their names.
pub(crate) fn corpus_files(target: &str) -> io::Result<Vec<(String, Vec<u8>)>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let file = |entry: io::Result<std::fs::DirEntry>| {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok((name, std::fs::read(path)?))
    };
    let mut files = folder.read_dir()?.map(file).collect::<io::Result<Vec<_>>>()?;
    files.sort();
    Ok(files)
}

/// Input `number` of a seed: first the corpus itself, then mutations of its files.
pub fn input(corpus: &[Vec<u8>], seed: u64, number: u64) -> Vec<u8> {
    if let Some(bytes) = usize::try_from(number).ok().and_then(|number| corpus.get(number)) {
        return bytes.clone();
    }
    let mut random = Random::for_stream(seed, number);
    let Some(bytes) = (!corpus.is_empty()).then(|| &corpus[random.index(corpus.len())]) else { return Vec::new() };
    let mut bytes = bytes.clone();
    for _ in 0..=random.index(4) {
        mutate(&mut bytes, corpus, &mut random);
    }
    bytes.truncate(MAX_BYTES);
    bytes
}

/// One change.
fn mutate(bytes: &mut Vec<u8>, corpus: &[Vec<u8>], random: &mut Random) {
    let at = place(bytes.len(), random);
    let end = (at + 1 + random.index(64)).min(bytes.len());
    match random.index(10) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end.max(at))),
        2 => drop(bytes.splice(at..at, (0..random.index(64)).map(|_| 0xff).collect::<Vec<_>>())),
        3 => {
            // For nesting and long lists: a short piece many times.
            let end = end.min(at + 1 + random.index(16));
            let piece = bytes[at..end.max(at)].to_vec();
            let n = 1 << random.index(12);
            drop(bytes.splice(at..at, piece.repeat(n.min(MAX_BYTES / piece.len().max(1)))));
        }
        4 => {
            // A piece of another file.
            let other = &corpus[random.index(corpus.len())];
            let from = random.index(other.len().max(1)).min(other.len());
            let to = (from + random.index(256)).min(other.len());
            drop(bytes.splice(at..end.max(at), other[from..to].iter().copied()));
        }
        5 | 6 => {
            let n_bytes = 1 << random.index(4);
            let value = EDGES[random.index(EDGES.len())];
            let mut value = value.to_le_bytes()[..n_bytes].to_vec();
            if random.chance(0.5) {
                value.reverse();
            }
            for (byte, value) in bytes.iter_mut().skip(at).zip(value) {
                *byte = value;
            }
        }
        7 => {
            // Another number in a text.
            let is_digit = |byte: &u8| byte.is_ascii_digit();
            let Some(first) = bytes.iter().skip(at).position(is_digit).map(|n| at + n) else { return };
            let last = bytes[first..].iter().position(|byte| !byte.is_ascii_digit()).map_or(bytes.len(), |n| first + n);
            let word = WORDS[random.index(WORDS.len())];
            drop(bytes.splice(first..last, word.bytes()));
        }
        _ => {
            for _ in 0..=random.index(8) {
                let at = place(bytes.len(), random);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = random.bits() as u8;
                }
            }
        }
    }
}

/// A position up to `len`. Headers are at the front, so the front is hit more often.
fn place(len: usize, random: &mut Random) -> usize {
    let reach = if random.index(2) == 0 { len.min(200) } else { len };
    random.index(reach.max(1)).min(len)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_depend_on_seed_and_number_alone() {
        let corpus = [b"width 10".to_vec(), b"height 20".to_vec()];
        assert_eq!(input(&corpus, 1, 0), corpus[0]);
        assert_eq!(input(&corpus, 1, 7), input(&corpus, 1, 7));
        let all: std::collections::BTreeSet<Vec<u8>> = (0..200).map(|number| input(&corpus, 1, number)).collect();
        assert!(all.len() > 150, "{}", all.len());
        assert!(input(&[], 1, 5).is_empty());
    }
}
