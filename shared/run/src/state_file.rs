//! The file of a saved state: the parts of the runner and of the stage behind one checksum, whole or absent.

use crate::checksum::Checksum;
use crate::health::{ReportedDoubt, Traffic};
use crate::packed::{Piece, pack, unpack};
use files::atomic_file::{AtomicFile, sync_all};
use files::regular_file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A saved state that cannot be loaded.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum StateError {
    /// The file is too short or lacks the magic bytes.
    #[error("not a whole saved state: {0} bytes")]
    Foreign(usize),
    /// Another version of the stage wrote the state.
    #[error("saved state has version {got}, expected {expected}")]
    Version {
        /// Version in the file.
        got: u32,
        /// Version of this program.
        expected: u32,
    },
    /// The content is incomplete or changed.
    #[error("saved state has checksum {got:016x}, expected {expected:016x}")]
    Checksum {
        /// Checksum of the bytes.
        got: u64,
        /// Checksum in the file.
        expected: u64,
    },
    /// The content does not decode.
    #[error("saved state does not decode: {0}")]
    Content(String),
    /// The file is absent or unreadable.
    #[error("cannot be read: {0}")]
    Unreadable(String),
}

/// A state file that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum StateFileError {
    /// The operating system refused.
    #[error("{path}: {cause}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Cause.
        #[source]
        cause: std::io::Error,
    },
    /// The content is not a state that this program can load.
    #[error("{path}: {cause}")]
    State {
        /// The file.
        path: PathBuf,
        /// Cause.
        #[source]
        cause: StateError,
    },
}

impl StateFileError {
    fn io(path: &Path, cause: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), cause }
    }
    fn state(path: &Path, cause: StateError) -> Self {
        Self::State { path: path.to_owned(), cause }
    }
}

/// First bytes of a state file.
const MAGIC: [u8; 8] = *b"REPLICAS";

/// Raised with every change of the layout below or of [`RunnerState`].
const RUNNER_STATE_VERSION: u32 = 5;

/// Bytes before the content of a state file.
///
/// | offset | content |
/// |---|---|
/// | 0 | magic bytes |
/// | 8 | version u32 |
/// | 12 | length of the runner's part u32 |
/// | 16 | checksum u64 of that length and of all that follows |
/// | 24 | the runner's part, then the stage's, packed |
const HEAD: usize = 24;

/// The state of a stage's runner at a barrier.
#[derive(Default, Serialize, Deserialize)]
pub struct RunnerState {
    /// Next tick.
    pub tick: u64,
    /// Number of the barrier.
    pub barrier: u64,
    /// Drive time of the first tick, ns since the Unix epoch.
    pub drive_begin: Option<i64>,
    /// Drive time at the barrier, ns since the Unix epoch.
    pub barrier_time: Option<i64>,
    /// Traffic by input topic.
    pub inputs: BTreeMap<String, Traffic>,
    /// Traffic by output topic.
    pub outputs: BTreeMap<String, Traffic>,
    /// Named counters of the stage.
    pub counters: BTreeMap<String, u64>,
    /// Notes of the stage.
    pub notes: Vec<String>,
    /// Doubts of the stage.
    pub doubts: Vec<ReportedDoubt>,
}

/// A state that is written but may not be on the disk yet.
pub struct WrittenState {
    file: AtomicFile,
    relied_on: Vec<PathBuf>,
}

impl WrittenState {
    /// Syncs the state to the disk after the files that it relies on. Only then does the file get its name.
    pub fn commit(self) -> Result<(), StateFileError> {
        sync_all(&self.relied_on).map_err(|(path, cause)| StateFileError::io(&path, cause))?;
        let path = self.file.path().to_owned();
        self.file.commit().map_err(|cause| StateFileError::io(&path, cause))?;
        // The folder of the barrier is new and, with the first barrier, its parent folder: their names must also be on
        // the disk.
        let around = path.ancestors().skip(2).take(2).filter(|folder| !folder.as_os_str().is_empty());
        for folder in around {
            let synced = File::open(folder).and_then(|folder| folder.sync_all());
            synced.map_err(|cause| StateFileError::io(folder, cause))?;
        }
        Ok(())
    }
}

/// Writes the runner's state and `stage`, the pieces of the stage's state. The file is whole or absent in any case:
/// [`WrittenState::commit`] makes it appear, once the files `relied_on` are on the disk.
pub fn write_state<'a>(
    path: &Path,
    runner: &RunnerState,
    stage: impl Iterator<Item = Piece<'a>>,
    relied_on: &[PathBuf],
) -> Result<WrittenState, StateFileError> {
    let runner = postcard::to_stdvec(runner)
        .map_err(|error| StateFileError::state(path, StateError::Content(error.to_string())))?;
    let file = write(path, &runner, stage).map_err(|cause| StateFileError::io(path, cause))?;
    Ok(WrittenState { file, relied_on: relied_on.to_vec() })
}

fn write<'a>(path: &Path, runner: &[u8], stage: impl Iterator<Item = Piece<'a>>) -> std::io::Result<AtomicFile> {
    std::fs::create_dir_all(path.parent().unwrap_or(Path::new(".")))?;
    let file = AtomicFile::create(path)?;
    let mut sum = checksum_of_len(runner.len());
    // The head is written last: each piece is added to the checksum while it is in the cache.
    file.file().write_all(&[0; HEAD])?;
    let mut add = |bytes: &[u8]| {
        sum.add(bytes);
        file.file().write_all(bytes)
    };
    add(runner)?;
    for piece in stage {
        pack(piece, &mut add)?;
    }
    let mut head = Vec::with_capacity(HEAD);
    head.extend_from_slice(&MAGIC);
    head.extend_from_slice(&RUNNER_STATE_VERSION.to_le_bytes());
    head.extend_from_slice(&(runner.len() as u32).to_le_bytes());
    head.extend_from_slice(&sum.sum().to_le_bytes());
    file.file().write_all_at(&head, 0)?;
    Ok(file)
}

/// The inverse of [`write_state`]: the parts of the runner and of the stage.
pub fn load_state(path: &Path) -> Result<(RunnerState, Vec<u8>), StateFileError> {
    let bytes = regular_file::read(path).map_err(|cause| StateFileError::io(path, cause))?;
    let (runner, stage) = split_state(&bytes).map_err(|cause| StateFileError::state(path, cause))?;
    let runner = postcard::from_bytes(runner)
        .map_err(|error| StateFileError::state(path, StateError::Content(error.to_string())))?;
    let stage = unpack(stage).map_err(|error| StateFileError::state(path, StateError::Content(error)))?;
    Ok((runner, stage))
}

/// Length of the stage's own part in a state file, bytes, packed. Reads only the head.
pub fn saved_bytes(path: &Path) -> std::io::Result<u64> {
    let mut file = regular_file::open(path)?;
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

/// Checks that a state file is whole: magic bytes, version, length and checksum. Reads it piece by piece, so that a
/// large file needs no memory. The stage's own part is not decoded.
pub fn verify_state(path: &Path) -> Result<(), StateError> {
    let unreadable = |cause: std::io::Error| StateError::Unreadable(cause.to_string());
    let mut file = regular_file::open(path).map_err(unreadable)?;
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

/// The bytes before the content.
struct Head {
    runner_len: usize,
    checksum: u64,
}

impl Head {
    /// Reads the head from the first bytes of a file of `file_len` bytes.
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

/// Bytes that are read at a time: few enough to stay in the cache.
const PIECE: usize = 256 << 10;

/// Starts the checksum with the length of the runner's part, which counts as content.
fn checksum_of_len(runner_len: usize) -> Checksum {
    let mut sum = Checksum::new();
    sum.add(&(runner_len as u64).to_le_bytes());
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torn_or_changed_state_file_is_refused() {
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
            doubts: vec![ReportedDoubt { name: "a_doubt".to_owned(), size: 0.5, text: "half of it".to_owned() }],
        };
        let stage: Vec<u8> = (0..100).collect();
        let relied_on = [folder.path().join("cloud.ply")];
        let pieces = || std::iter::once(Piece::plain(&stage));
        let write = || write_state(&path, &runner, pieces(), &relied_on).expect("writes");
        let unsaved = write().commit();
        assert!(unsaved.is_err_and(|error| error.to_string().contains("cloud.ply")), "what it relies on is not there");
        assert!(!path.exists());
        std::fs::write(folder.path().join("cloud.ply"), "points").expect("writes");
        write().commit().expect("saves");
        let (back, stage_back) = load_state(&path).expect("loads");
        assert_eq!((back.tick, back.barrier, back.drive_begin, back.counters), (7, 3, Some(-5), runner.counters));
        assert_eq!((back.notes, back.doubts), (runner.notes, runner.doubts));
        assert_eq!(stage_back, stage);
        assert_eq!(saved_bytes(&path).expect("a state"), 110, "a block of bytes that do not become shorter");
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
    fn state_longer_than_a_piece_is_verified_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("stage.state");
        let stage: Vec<u8> = (0..3 * PIECE + 5).map(|i| (i * i % 251) as u8).collect();
        let pieces = std::iter::once(Piece { bytes: &stage, row_bytes: 7 });
        write_state(&path, &RunnerState::default(), pieces, &[]).expect("writes").commit().expect("saves");
        assert_eq!(verify_state(&path), Ok(()));
        assert_eq!(load_state(&path).expect("loads").1, stage);
        let mut bytes = std::fs::read(&path).expect("written");
        *bytes.last_mut().expect("bytes") ^= 1;
        std::fs::write(&path, &bytes).expect("writes");
        assert!(matches!(verify_state(&path), Err(StateError::Checksum { .. })));
    }
}
