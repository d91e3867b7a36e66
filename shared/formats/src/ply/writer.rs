//! Writing clouds.

use super::{Header, Kind, PlyError, Row, RowMismatch};
use files::atomic_file::AtomicFile;
use rayon::prelude::*;
use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::Errno;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Rows per block and thread: at 64 bytes a row, a block fits the second-level cache of a core.
const BLOCK_ROWS: usize = 16384;

/// Writes one cloud on all threads of the rayon pool. [`PlyWriter::finish`] gives the file its name when it is complete
/// and on the disk. A writer that is dropped earlier leaves no file.
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

/// Reserves the blocks of a file on the disk: the kernel then needs less time for each write, and a full disk is detected
/// before the first row. Not all file systems support it.
fn reserve_space(file: &File, n_bytes: u64) -> io::Result<()> {
    match fallocate(file, FallocateFlags::empty(), 0, n_bytes) {
        Err(error @ (Errno::NOSPC | Errno::DQUOT)) => Err(error.into()),
        _ => Ok(()),
    }
}

impl PlyWriter {
    /// Creates a cloud of exactly `n_points` rows. The folder must exist.
    pub fn create(path: &Path, header: &Header, n_points: usize) -> Result<Self, PlyError> {
        let encoded = header.encode(n_points, path)?;
        let file = AtomicFile::create(path).map_err(PlyError::io(path, "create"))?;
        file.file().write_all_at(&encoded, 0).map_err(PlyError::io(path, "write"))?;
        let writer = Self {
            file,
            kinds: header.properties.iter().map(|property| property.kind).collect(),
            row_size: header.row_size(),
            header_len: encoded.len(),
            n_points,
            n_written: 0,
        };
        reserve_space(writer.file.file(), writer.n_bytes()).map_err(PlyError::io(path, "write"))?;
        Ok(writer)
    }

    /// Appends `n` rows. `encode` appends the fields of row `i`, 0 to `n - 1`. The bytes do not depend on the number of threads.
    pub fn write_each(&mut self, n: usize, encode: impl Fn(usize, &mut Row<'_>) + Sync) -> Result<(), PlyError> {
        self.write_amended(n, encode, |_, _| Ok(()))
    }

    /// Like [`PlyWriter::write_each`]. `amend` receives each block of encoded rows with the number of its first row and may change
    /// it.
    pub fn write_amended(
        &mut self,
        n: usize,
        encode: impl Fn(usize, &mut Row<'_>) + Sync,
        amend: impl Fn(usize, &mut [u8]) -> Result<(), PlyError> + Sync,
    ) -> Result<(), PlyError> {
        let path = self.file.path().to_owned();
        let start = self.n_written;
        let kinds = self.kinds.clone();
        let row_size = self.row_size;
        self.write_blocks(n, |first, block| {
            for (i, bytes) in block.chunks_exact_mut(row_size.max(1)).enumerate() {
                // All rows are encoded by the same code, so checking the kinds of the first row is enough.
                let checked_kinds = if first + i == 0 { kinds.as_slice() } else { &[] };
                let mut row = Row::new(bytes, checked_kinds);
                encode(first + i, &mut row);
                let point = start + first + i;
                row.check().map_err(|reason| PlyError::Row { path: path.clone(), point, reason })?;
            }
            amend(first, block)
        })
    }

    /// Appends `n` rows by blocks. `fill` receives the number of the first row of a block and its bytes, whose content is undefined.
    /// It writes packed fields in the order of the header, little-endian, without padding.
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

    /// Size of the complete file, bytes.
    pub fn n_bytes(&self) -> u64 {
        self.offset(self.n_points)
    }

    /// Syncs the cloud to the disk and gives it its name. Returns the size of the file in bytes.
    pub fn finish(self) -> Result<u64, PlyError> {
        self.finish_by(AtomicFile::commit)
    }

    /// Gives the cloud its name without syncing. Call [`files::atomic_file::sync_all`] later.
    pub fn finish_unsynced(self) -> Result<u64, PlyError> {
        self.finish_by(AtomicFile::commit_unsynced)
    }

    fn finish_by(self, commit: impl FnOnce(AtomicFile) -> io::Result<()>) -> Result<u64, PlyError> {
        if self.n_written != self.n_points {
            return Err(self.wrong_count(self.n_written));
        }
        let path: PathBuf = self.file.path().to_owned();
        let size = self.n_bytes();
        commit(self.file).map_err(PlyError::io(&path, "finish"))?;
        Ok(size)
    }

    /// Reserves the next `n` rows. Returns the number of the first.
    fn reserve(&mut self, n: usize) -> Result<usize, PlyError> {
        let start = self.n_written;
        if n > self.n_points - start {
            return Err(self.wrong_count(self.n_points));
        }
        self.n_written += n;
        Ok(start)
    }

    fn offset(&self, row: usize) -> u64 {
        self.header_len as u64 + row as u64 * self.row_size as u64
    }

    fn wrong_count(&self, point: usize) -> PlyError {
        let reason = RowMismatch::Count { n_points: self.n_points };
        PlyError::Row { path: self.file.path().to_owned(), point, reason }
    }
}
