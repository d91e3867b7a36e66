//! The file of a state: the runner's part and the stage's behind one checksum, whole or absent.

use super::checksum::Checksum;
use super::{StateBytes, StateError};
use crate::StepError;
use crate::health::Traffic;
use formats::atomic_file::{AtomicFile, sync_all};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// First bytes of a state file.
const MAGIC: [u8; 8] = *b"REPLICAS";

/// Raised with every change of the layout below or of [`RunnerState`].
const RUNNER_STATE_VERSION: u32 = 4;

/// Bytes before the content of a state file.
///
/// | offset | content |
/// |---|---|
/// | 0 | magic bytes |
/// | 8 | version u32 |
/// | 12 | length of the runner's part u32 |
/// | 16 | checksum u64 of that length and of all that follows |
/// | 24 | the runner's part, then the stage's |
const HEAD: usize = 24;

/// A stage's runner at a barrier.
#[derive(Default, Serialize, Deserialize)]
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

/// A state that is written but may not have come to the disk.
pub(crate) struct WrittenState {
    file: AtomicFile,
    relied_on: Vec<PathBuf>,
}

impl WrittenState {
    /// Brings it to the disk, after the files that it relies on; only then has it its name.
    pub(crate) fn commit(self) -> Result<(), StepError> {
        let failed = |path: &Path, cause: &std::io::Error| StepError::Io(format!("{}: {cause}", path.display()));
        sync_all(&self.relied_on).map_err(|(path, cause)| failed(&path, &cause))?;
        let path = self.file.path().to_owned();
        self.file.commit().map_err(|cause| failed(&path, &cause))
    }
}

/// Writes runner and stage. The file is whole or absent, whatever happens meanwhile: [`WrittenState::commit`] makes it appear.
pub(crate) fn write_state(
    path: &Path,
    runner: &RunnerState,
    stage: &StateBytes<'_>,
) -> Result<WrittenState, StepError> {
    let runner = postcard::to_stdvec(runner).map_err(|error| StateError::Content(error.to_string()))?;
    let file = write(path, &runner, stage).map_err(|error| StepError::Io(format!("{}: {error}", path.display())))?;
    Ok(WrittenState { file, relied_on: stage.files().to_vec() })
}

fn write(path: &Path, runner: &[u8], stage: &StateBytes<'_>) -> std::io::Result<AtomicFile> {
    std::fs::create_dir_all(path.parent().unwrap_or(Path::new(".")))?;
    let file = AtomicFile::create(path)?;
    let mut sum = checksum_of_len(runner.len());
    // The head comes last: its checksum is taken of each piece while that is in the cache.
    file.file().write_all(&[0; HEAD])?;
    for piece in std::iter::once(runner).chain(stage.pieces()).flat_map(|piece| piece.chunks(PIECE)) {
        sum.add(piece);
        file.file().write_all(piece)?;
    }
    let mut head = Vec::with_capacity(HEAD);
    head.extend_from_slice(&MAGIC);
    head.extend_from_slice(&RUNNER_STATE_VERSION.to_le_bytes());
    head.extend_from_slice(&(runner.len() as u32).to_le_bytes());
    head.extend_from_slice(&sum.sum().to_le_bytes());
    file.file().write_all_at(&head, 0)?;
    Ok(file)
}

/// The inverse of [`write_state`]: the runner's part and the stage's.
pub(crate) fn load_state(path: &Path) -> Result<(RunnerState, Vec<u8>), StepError> {
    let error = |text: String| StepError::Io(format!("{}: {text}", path.display()));
    let bytes = std::fs::read(path).map_err(|cause| error(cause.to_string()))?;
    let (runner, stage) = split_state(&bytes).map_err(|cause| error(cause.to_string()))?;
    let runner = postcard::from_bytes(runner).map_err(|cause| error(cause.to_string()))?;
    Ok((runner, stage.to_vec()))
}

/// Length of the stage's own part of a state file, bytes. Reads no more than the head.
pub fn saved_bytes(path: &Path) -> std::io::Result<u64> {
    let mut file = std::fs::File::open(path)?;
    let mut head = [0; HEAD];
    file.read_exact(&mut head)?;
    let runner = u32::from_le_bytes([head[12], head[13], head[14], head[15]]);
    Ok(file.metadata()?.len().saturating_sub(HEAD as u64 + u64::from(runner)))
}

fn split_state(bytes: &[u8]) -> Result<(&[u8], &[u8]), StateError> {
    let (head, content) = bytes.split_first_chunk::<HEAD>().ok_or(StateError::Foreign(bytes.len()))?;
    let head = Head::read(head, bytes.len())?;
    let mut sum = checksum_of_len(head.runner_len);
    sum.add(content);
    head.check(sum.sum())?;
    Ok(content.split_at(head.runner_len))
}

/// Whether a state file is whole: magic bytes, version, length and checksum. Reads it piece by piece, so that a large one
/// costs no memory. What the stage's own part means, only the stage can say.
pub fn verify_state(path: &Path) -> Result<(), StateError> {
    let unreadable = |cause: std::io::Error| StateError::Unreadable(cause.to_string());
    let mut file = File::open(path).map_err(unreadable)?;
    let len = file.metadata().map_err(unreadable)?.len() as usize;
    let mut head = [0; HEAD];
    if len < HEAD {
        return Err(StateError::Foreign(len));
    }
    file.read_exact(&mut head).map_err(unreadable)?;
    let head = Head::read(&head, len)?;
    let mut piece = vec![0; PIECE];
    let mut sum = checksum_of_len(head.runner_len);
    let mut left = len - HEAD;
    while left > 0 {
        let piece = &mut piece[..left.min(PIECE)];
        file.read_exact(piece).map_err(unreadable)?;
        sum.add(piece);
        left -= piece.len();
    }
    head.check(sum.sum())
}

/// What stands before the content.
struct Head {
    runner_len: usize,
    checksum: u64,
}

impl Head {
    /// From the first bytes of a file of `file_len` bytes.
    fn read(head: &[u8; HEAD], file_len: usize) -> Result<Self, StateError> {
        let u32_at = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        if !head.starts_with(&MAGIC) {
            return Err(StateError::Foreign(file_len));
        }
        if u32_at(8) != RUNNER_STATE_VERSION {
            return Err(StateError::Version { got: u32_at(8), expected: RUNNER_STATE_VERSION });
        }
        let runner_len = u32_at(12) as usize;
        if runner_len > file_len - HEAD {
            return Err(StateError::Foreign(file_len));
        }
        Ok(Self { runner_len, checksum: u64::from(u32_at(16)) | u64::from(u32_at(20)) << 32 })
    }

    fn check(&self, got: u64) -> Result<(), StateError> {
        if got == self.checksum { Ok(()) } else { Err(StateError::Checksum { got, expected: self.checksum }) }
    }
}

/// Bytes that are read or written at a time: few enough to stay in the cache.
const PIECE: usize = 256 << 10;

/// Begins the checksum: where the runner's part ends is content, too.
fn checksum_of_len(runner_len: usize) -> Checksum {
    let mut sum = Checksum::new();
    sum.add(&(runner_len as u64).to_le_bytes());
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut bytes = StateBytes::from(stage.clone());
        bytes.rely_on([folder.path().join("cloud.ply")]);
        let unsaved = write_state(&path, &runner, &bytes).expect("writes").commit();
        assert!(unsaved.is_err_and(|error| error.to_string().contains("cloud.ply")), "what it relies on is not there");
        assert!(!path.exists());
        std::fs::write(folder.path().join("cloud.ply"), "points").expect("writes");
        write_state(&path, &runner, &bytes).expect("writes").commit().expect("saves");
        let (back, stage_back) = load_state(&path).expect("loads");
        assert_eq!((back.tick, back.barrier, back.drive_begin, back.counters), (7, 3, Some(-5), runner.counters));
        assert_eq!(stage_back, stage);
        assert_eq!(saved_bytes(&path).expect("a state"), 100);
        let bytes = std::fs::read(&path).expect("written");
        let both_refuse = |bytes: &[u8], what: &str| {
            let loaded = split_state(bytes).map(drop);
            std::fs::write(&path, bytes).expect("writes");
            assert_eq!(verify_state(&path), loaded, "{what}");
            assert!(loaded.is_err(), "{what}");
        };
        assert_eq!(verify_state(&path), Ok(()));
        for cut in 0..bytes.len() {
            both_refuse(&bytes[..cut], &format!("cut to {cut} bytes"));
        }
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x40;
            both_refuse(&changed, &format!("byte {at} changed"));
        }
        both_refuse(&[&bytes[..], b"more"].concat(), "longer");
        std::fs::remove_file(&path).expect("removes");
        assert!(matches!(verify_state(&path), Err(StateError::Unreadable(_))));
    }

    #[test]
    fn a_state_longer_than_a_piece_is_verified_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("stage.state");
        let stage: Vec<u8> = (0..3 * PIECE + 5).map(|i| (i * i % 251) as u8).collect();
        write_state(&path, &RunnerState::default(), &stage.into()).expect("writes").commit().expect("saves");
        assert_eq!(verify_state(&path), Ok(()));
        let mut bytes = std::fs::read(&path).expect("written");
        *bytes.last_mut().expect("bytes") ^= 1;
        std::fs::write(&path, &bytes).expect("writes");
        assert!(matches!(verify_state(&path), Err(StateError::Checksum { .. })));
    }
}
