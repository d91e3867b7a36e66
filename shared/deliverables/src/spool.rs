//! Records that wait in a file until their tile or node is written.

use crate::error::DeliverError;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A temporary file with the records of each key, in the order in which they were added. Only places in the file are in memory.
pub(crate) struct Spool<K> {
    /// Without a name: it vanishes with the process.
    file: File,
    /// The folder, for errors.
    folder: PathBuf,
    record_bytes: usize,
    n_bytes: u64,
    pieces: BTreeMap<K, Vec<Piece>>,
}

/// Records that lie together.
#[derive(Clone, Copy, Debug)]
struct Piece {
    at: u64,
    n_points: u32,
}

impl<K: Ord + Copy + Send + Sync> Spool<K> {
    /// A spool in `folder`, where there must be room for all records.
    pub(crate) fn create(folder: &Path, record_bytes: usize) -> Result<Self, DeliverError> {
        let file = tempfile::tempfile_in(folder).map_err(DeliverError::file(folder, "create a temporary file"))?;
        Ok(Self { file, folder: folder.to_owned(), record_bytes, n_bytes: 0, pieces: BTreeMap::new() })
    }

    /// Adds a block of records, whose keys are given.
    pub(crate) fn add(&mut self, records: &[u8], keys: &[K]) -> Result<(), DeliverError> {
        let mut order: Vec<u32> = (0..keys.len() as u32).collect();
        order.par_sort_by_key(|i| keys[*i as usize]);
        let mut sorted = vec![0; records.len()];
        for (to, i) in sorted.chunks_exact_mut(self.record_bytes).zip(&order) {
            let from = *i as usize * self.record_bytes;
            to.copy_from_slice(&records[from..from + self.record_bytes]);
        }
        self.file
            .write_all_at(&sorted, self.n_bytes)
            .map_err(DeliverError::file(&self.folder, "write a temporary file"))?;
        for run in order.chunk_by(|a, b| keys[*a as usize] == keys[*b as usize]) {
            let piece = Piece { at: self.n_bytes, n_points: run.len() as u32 };
            self.pieces.entry(keys[run[0] as usize]).or_default().push(piece);
            self.n_bytes += (run.len() * self.record_bytes) as u64;
        }
        Ok(())
    }

    /// Keys with records, and the number of each.
    pub(crate) fn keys(&self) -> Vec<(K, u64)> {
        let n_points = |pieces: &[Piece]| pieces.iter().map(|piece| u64::from(piece.n_points)).sum();
        self.pieces.iter().map(|(key, pieces)| (*key, n_points(pieces))).collect()
    }

    /// Passes the records of a key to `take`, in pieces of `most_points`, the last one of less.
    pub(crate) fn each_piece(
        &self,
        key: &K,
        most_points: usize,
        mut take: impl FnMut(&[u8]) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError> {
        let mut bytes: Vec<u8> = Vec::new();
        for piece in self.pieces.get(key).into_iter().flatten() {
            let (mut at, mut left) = (piece.at, piece.n_points as usize);
            while left > 0 {
                let n = left.min(most_points - bytes.len() / self.record_bytes);
                let begin = bytes.len();
                bytes.resize(begin + n * self.record_bytes, 0);
                self.file
                    .read_exact_at(&mut bytes[begin..], at)
                    .map_err(DeliverError::file(&self.folder, "read a temporary file"))?;
                at += (n * self.record_bytes) as u64;
                left -= n;
                if bytes.len() / self.record_bytes == most_points {
                    take(&bytes)?;
                    bytes.clear();
                }
            }
        }
        if bytes.is_empty() { Ok(()) } else { take(&bytes) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_of_a_key_come_back_in_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut spool = Spool::create(folder.path(), 2).expect("creates");
        spool.add(&[0, 0, 1, 1, 2, 2, 3, 3], &[7, 5, 7, 5]).expect("adds");
        spool.add(&[4, 4, 5, 5, 6, 6], &[7, 7, 9]).expect("adds");
        assert_eq!(spool.keys(), [(5, 2), (7, 4), (9, 1)]);
        let mut pieces: Vec<Vec<u8>> = Vec::new();
        let mut take = |bytes: &[u8]| {
            pieces.push(bytes.to_vec());
            Ok(())
        };
        spool.each_piece(&7, 3, &mut take).expect("reads");
        spool.each_piece(&5, 3, &mut take).expect("reads");
        spool.each_piece(&1, 3, &mut take).expect("has none");
        assert_eq!(pieces, [vec![0, 0, 2, 2, 4, 4], vec![5, 5], vec![1, 1, 3, 3]]);
        assert_eq!(std::fs::read_dir(folder.path()).expect("lists").count(), 0, "the file has no name");
    }

    #[test]
    fn folder_that_cannot_be_written_is_named() {
        let error = Spool::<u8>::create(Path::new("/nowhere/out"), 2).err().expect("fails").to_string();
        assert!(error.starts_with("/nowhere/out: cannot create a temporary file"), "{error}");
    }
}
