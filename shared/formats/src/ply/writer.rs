//! Clouds onto the disk.

use super::{Header, Kind, PlyError, Row};
use crate::atomic_file::AtomicFile;
use rayon::prelude::*;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Rows that one thread encodes at a time: at 64 bytes a row this stays inside a core's second-level cache.
const CHUNK_ROWS: usize = 4096;

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

    /// Appends rows that are packed already: fields in the header's order, little-endian, without padding.
    pub fn write_rows(&mut self, packed: &[u8]) -> Result<(), PlyError> {
        if self.row_size == 0 || !packed.len().is_multiple_of(self.row_size) {
            let rule = format!("{} bytes are no multiple of the row's {} bytes", packed.len(), self.row_size);
            return Err(self.row_error(self.n_written, rule));
        }
        let start = self.reserve(packed.len() / self.row_size)?;
        self.file.file().write_all_at(packed, self.offset(start)).map_err(PlyError::io(self.file.path(), "write"))
    }

    /// Appends `n` rows: `encode` gives the fields of row `i`, 0 to `n - 1`. Rows are encoded by all threads of the
    /// rayon pool; the bytes depend on `encode` alone.
    pub fn write_each(&mut self, n: usize, encode: impl Fn(usize, &mut Row<'_>) + Sync) -> Result<(), PlyError> {
        let start = self.reserve(n)?;
        let this = &*self;
        (0..n.div_ceil(CHUNK_ROWS)).into_par_iter().try_for_each_init(Vec::new, |buffer, chunk| {
            let first = chunk * CHUNK_ROWS;
            let rows = CHUNK_ROWS.min(n - first);
            buffer.resize(rows * this.row_size, 0);
            for (i, bytes) in buffer.chunks_exact_mut(this.row_size.max(1)).enumerate() {
                // All rows come out of the same code, so the kinds of the first one speak for all.
                let watched = if first + i == 0 { this.kinds.as_slice() } else { &[] };
                let mut row = Row::new(bytes, watched);
                encode(first + i, &mut row);
                row.check().map_err(|rule| this.row_error(start + first + i, rule))?;
            }
            let at = this.offset(start + first);
            this.file.file().write_all_at(buffer, at).map_err(PlyError::io(this.file.path(), "write"))
        })
    }

    /// Brings the cloud to the disk and gives it its name. The answer is the file's size in bytes.
    pub fn finish(self) -> Result<u64, PlyError> {
        if self.n_written != self.n_points {
            return Err(self.row_error(self.n_written, format!("the header promises {} points", self.n_points)));
        }
        let path: PathBuf = self.file.path().to_owned();
        let size = self.offset(self.n_points);
        self.file.commit().map_err(PlyError::io(&path, "finish"))?;
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
