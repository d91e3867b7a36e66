//! Clouds onto the disk.

use super::{Header, Kind, PlyError, Row};
use crate::atomic_file::AtomicFile;
use rayon::prelude::*;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Rows that one thread has at a time: at 64 bytes a row this stays inside a core's second-level cache.
const BLOCK_ROWS: usize = 4096;

/// Writes one cloud, row by row or by many threads at once. The file appears under its name in [`PlyWriter::finish`],
/// whole and on the disk; dropped before that, it leaves nothing.
///
/// ```
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("cloud.ply");
/// use formats::ply::{Header, Kind, PlyWriter, Vertices};
/// let points = [[0.5_f32, 1.0, 2.0], [3.0, 4.0, 5.0]];
/// let header = Header::new([("x", Kind::Float), ("y", Kind::Float), ("z", Kind::Float), ("ring", Kind::UChar)]);
/// let mut writer = PlyWriter::create(&path, &header, points.len())?;
/// writer.write_each(points.len(), |i, row| {
///     let [x, y, z] = points[i];
///     row.f32(x).f32(y).f32(z).u8(7);
/// })?;
/// writer.finish()?;
/// assert_eq!(Vertices::load(&path)?.f32s("y")?, [1.0, 4.0]);
/// # Ok::<(), formats::ply::PlyError>(())
/// ```
#[derive(Debug)]
pub struct PlyWriter {
    file: AtomicFile,
    kinds: Vec<Kind>,
    row_size: usize,
    header_len: usize,
    n_points: usize,
    n_written: usize,
}

impl PlyWriter {
    /// Starts a cloud of exactly `n_points` rows. The folder must exist.
    pub fn create(path: &Path, header: &Header, n_points: usize) -> Result<Self, PlyError> {
        let text = header.encode(n_points, path)?;
        let file = AtomicFile::create(path).map_err(PlyError::io(path, "create"))?;
        file.file().write_all_at(text.as_bytes(), 0).map_err(PlyError::io(path, "write"))?;
        Ok(Self {
            file,
            kinds: header.properties.iter().map(|property| property.kind).collect(),
            row_size: header.row_size(),
            header_len: text.len(),
            n_points,
            n_written: 0,
        })
    }

    /// Appends `n` rows: `encode` gives the fields of row `i`, 0 to `n - 1`. Rows are encoded by all threads of the
    /// rayon pool; the bytes depend on `encode` alone.
    pub fn write_each(&mut self, n: usize, encode: impl Fn(usize, &mut Row<'_>) + Sync) -> Result<(), PlyError> {
        self.write_amended(n, encode, |_, _| Ok(()))
    }

    /// The same, and `amend` gets each block of encoded rows as `fill` of [`PlyWriter::write_blocks`] does, and may change them.
    pub fn write_amended(
        &mut self,
        n: usize,
        encode: impl Fn(usize, &mut Row<'_>) + Sync,
        amend: impl Fn(usize, &mut [u8]) -> Result<(), PlyError> + Sync,
    ) -> Result<(), PlyError> {
        let (path, start) = (self.file.path().to_owned(), self.n_written);
        let (kinds, row_size) = (self.kinds.clone(), self.row_size);
        self.write_blocks(n, |first, block| {
            for (i, bytes) in block.chunks_exact_mut(row_size.max(1)).enumerate() {
                // All rows come out of the same code, so the kinds of the first one speak for all.
                let watched = if first + i == 0 { kinds.as_slice() } else { &[] };
                let mut row = Row::new(bytes, watched);
                encode(first + i, &mut row);
                row.check().map_err(|rule| PlyError::Row { path: path.clone(), point: start + first + i, rule })?;
            }
            amend(first, block)
        })
    }

    /// The same by blocks: `fill` gets the number of a block's first row and the bytes of its rows, with whatever is in them,
    /// and packs the fields there in the header's order, little-endian, without padding.
    pub fn write_blocks(
        &mut self,
        n: usize,
        fill: impl Fn(usize, &mut [u8]) -> Result<(), PlyError> + Sync,
    ) -> Result<(), PlyError> {
        let start = self.reserve(n)?;
        let this = &*self;
        (0..n.div_ceil(BLOCK_ROWS)).into_par_iter().try_for_each_init(Vec::new, |block, index| {
            let first = index * BLOCK_ROWS;
            block.resize(BLOCK_ROWS.min(n - first) * this.row_size, 0);
            fill(first, block)?;
            let at = this.offset(start + first);
            this.file.file().write_all_at(block, at).map_err(PlyError::io(this.file.path(), "write"))
        })
    }

    /// Size of the file when all rows are there.
    pub fn n_bytes(&self) -> u64 {
        self.offset(self.n_points)
    }

    /// Brings the cloud to the disk and gives it its name. The answer is the file's size in bytes.
    pub fn finish(self) -> Result<u64, PlyError> {
        self.finish_by(AtomicFile::commit)
    }

    /// Gives the cloud its name; to bring it to the disk is left to [`crate::atomic_file::sync_all`].
    pub fn finish_unsynced(self) -> Result<u64, PlyError> {
        self.finish_by(AtomicFile::commit_unsynced)
    }

    fn finish_by(self, commit: impl FnOnce(AtomicFile) -> io::Result<()>) -> Result<u64, PlyError> {
        if self.n_written != self.n_points {
            return Err(self.row_error(self.n_written, format!("the header promises {} points", self.n_points)));
        }
        let path: PathBuf = self.file.path().to_owned();
        let size = self.n_bytes();
        commit(self.file).map_err(PlyError::io(&path, "finish"))?;
        Ok(size)
    }

    /// Claims the next `n` rows and gives the number of the first one.
    fn reserve(&mut self, n: usize) -> Result<usize, PlyError> {
        let start = self.n_written;
        if n > self.n_points - start {
            return Err(self.row_error(self.n_points, format!("the header promises {} points", self.n_points)));
        }
        self.n_written += n;
        Ok(start)
    }

    fn offset(&self, row: usize) -> u64 {
        self.header_len as u64 + row as u64 * self.row_size as u64
    }

    fn row_error(&self, point: usize, rule: String) -> PlyError {
        PlyError::Row { path: self.file.path().to_owned(), point, rule }
    }
}
