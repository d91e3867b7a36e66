//! Records that are buffered until their tile or node is written.

use crate::error::DeliverError;
use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Bytes buffered in memory before they are written: small drives need no file.
const WAITING_BYTES: usize = 1 << 28;

/// The records of each key, in the order in which they were added: the latest ones in memory, earlier ones in a temporary
/// file.
pub struct Spool<K> {
    /// Unnamed: it is deleted when the process ends.
    file: File,
    /// The folder, for error messages.
    folder: PathBuf,
    record_bytes: usize,
    n_file_bytes: u64,
    n_waiting_bytes: usize,
    most_waiting_bytes: usize,
    keys: BTreeMap<K, OfKey>,
}

/// The records of one key.
#[derive(Default)]
struct OfKey {
    pieces: Vec<Piece>,
    /// Records after the records of the pieces.
    waiting: Vec<u8>,
}

/// Consecutive records in the file.
#[derive(Clone, Copy, Debug)]
struct Piece {
    at: u64,
    n_bytes: usize,
}

/// A key with records.
pub struct KeyedRecords<K> {
    /// The key.
    pub key: K,
    /// Number of its records.
    pub n: u64,
}

impl<K: Ord + Copy> Spool<K> {
    /// Creates a spool in `folder`, which needs space for all records.
    pub fn create(folder: &Path, record_bytes: usize) -> Result<Self, DeliverError> {
        let file = tempfile::tempfile_in(folder).map_err(DeliverError::file(folder, "create a temporary file"))?;
        Ok(Self {
            file,
            folder: folder.to_owned(),
            record_bytes,
            n_file_bytes: 0,
            n_waiting_bytes: 0,
            most_waiting_bytes: WAITING_BYTES,
            keys: BTreeMap::new(),
        })
    }

    /// Adds records with the given keys. This is fastest if neighbors have the same key.
    pub fn add(&mut self, records: &[u8], keys: &[K]) -> Result<(), DeliverError> {
        let mut at = 0;
        for run in keys.chunk_by(PartialEq::eq) {
            let end = at + run.len() * self.record_bytes;
            self.keys.entry(run[0]).or_default().waiting.extend_from_slice(&records[at..end]);
            at = end;
        }
        self.n_waiting_bytes += records.len();
        if self.n_waiting_bytes > self.most_waiting_bytes { self.write_waiting() } else { Ok(()) }
    }

    /// Writes the keys with most waiting records until half of the bytes are left. This gives the fewest pieces, and the
    /// places that the vehicle is passing often need no file.
    fn write_waiting(&mut self) -> Result<(), DeliverError> {
        let mut longest: Vec<&mut OfKey> = self.keys.values_mut().filter(|of_key| !of_key.waiting.is_empty()).collect();
        longest.sort_by_key(|of_key| std::cmp::Reverse(of_key.waiting.len()));
        for OfKey { pieces, waiting } in longest {
            if self.n_waiting_bytes <= self.most_waiting_bytes / 2 {
                break;
            }
            self.n_waiting_bytes -= waiting.len();
            self.file
                .write_all_at(waiting, self.n_file_bytes)
                .map_err(DeliverError::file(&self.folder, "write a temporary file"))?;
            pieces.push(Piece { at: self.n_file_bytes, n_bytes: waiting.len() });
            self.n_file_bytes += waiting.len() as u64;
            *waiting = Vec::new();
        }
        Ok(())
    }

    /// Size of a record.
    pub fn record_bytes(&self) -> usize {
        self.record_bytes
    }

    /// Keys with records.
    pub fn keys(&self) -> Vec<KeyedRecords<K>> {
        let n_bytes =
            |of_key: &OfKey| of_key.pieces.iter().map(|piece| piece.n_bytes).sum::<usize>() + of_key.waiting.len();
        let counted =
            |(key, of_key): (&K, &OfKey)| KeyedRecords { key: *key, n: (n_bytes(of_key) / self.record_bytes) as u64 };
        self.keys.iter().map(counted).collect()
    }

    /// Passes the records of a key to `take`, in pieces of `most_points`; the last piece may be shorter.
    pub fn each_piece(
        &self,
        key: &K,
        most_points: usize,
        mut take: impl FnMut(&[u8]) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError> {
        let Some(OfKey { pieces, waiting }) = self.keys.get(key) else { return Ok(()) };
        let most_bytes = most_points.saturating_mul(self.record_bytes);
        let mut bytes: Vec<u8> = Vec::new();
        for piece in pieces {
            let mut at = piece.at;
            let mut left = piece.n_bytes;
            while left > 0 {
                let n = left.min(most_bytes - bytes.len());
                let begin = bytes.len();
                bytes.resize(begin + n, 0);
                self.file
                    .read_exact_at(&mut bytes[begin..], at)
                    .map_err(DeliverError::file(&self.folder, "read a temporary file"))?;
                at += n as u64;
                left -= n;
                if bytes.len() == most_bytes {
                    take(&bytes)?;
                    bytes.clear();
                }
            }
        }
        let mut waiting = waiting.as_slice();
        if !bytes.is_empty() {
            let (first, rest) = waiting.split_at(waiting.len().min(most_bytes - bytes.len()));
            bytes.extend_from_slice(first);
            take(&bytes)?;
            waiting = rest;
        }
        waiting.chunks(most_bytes).try_for_each(take)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_of_a_key_come_back_in_order() {
        let folder = tempfile::tempdir().expect("a folder");
        // All in memory, some in the file, all in the file.
        for most_waiting_bytes in [100, 13, 7, 0] {
            let mut spool = Spool { most_waiting_bytes, ..Spool::create(folder.path(), 2).expect("creates") };
            spool.add(&[0, 0, 1, 1, 2, 2, 3, 3], &[7, 5, 7, 5]).expect("adds");
            spool.add(&[4, 4, 5, 5, 6, 6], &[7, 7, 9]).expect("adds");
            let counts: Vec<[u64; 2]> = spool.keys().iter().map(|records| [records.key, records.n]).collect();
            assert_eq!(counts, [[5, 2], [7, 4], [9, 1]]);
            let mut pieces: Vec<Vec<u8>> = Vec::new();
            let mut take = |bytes: &[u8]| {
                pieces.push(bytes.to_vec());
                Ok(())
            };
            spool.each_piece(&7, 3, &mut take).expect("reads");
            spool.each_piece(&5, usize::MAX, &mut take).expect("reads");
            spool.each_piece(&1, 3, &mut take).expect("reads");
            let expected = [vec![0, 0, 2, 2, 4, 4], vec![5, 5], vec![1, 1, 3, 3]];
            assert_eq!(pieces, expected, "{most_waiting_bytes} bytes in memory");
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("lists").count(), 0, "the file has no name");
    }

    #[test]
    fn folder_that_cannot_be_written_is_named() {
        let error = Spool::<u8>::create(Path::new("/nowhere/out"), 2).err().expect("fails").to_string();
        assert!(error.starts_with("/nowhere/out: cannot create a temporary file"), "{error}");
    }
}
