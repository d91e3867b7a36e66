//! Reading clouds block by block.

use super::reader::{MAX_HEADER, header_len, is_plain, parse_header, plain_rows, scalar_properties};
use super::{Header, HeaderFault, PlyError};
use ply_rs::ply::Encoding;
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A cloud as [`super::PlyWriter`] writes it. Only the header is in memory; rows are read on demand, so clouds of any size can be
/// processed in bounded memory.
#[derive(Debug)]
pub struct PlyRows {
    path: PathBuf,
    file: File,
    header: Header,
    n_points: usize,
    /// Offset of the first row.
    rows_at: u64,
    n_bytes: u64,
}

impl PlyRows {
    /// Reads the header. Only binary little-endian files without lists before or in their vertices are supported.
    pub fn open(path: &Path) -> Result<Self, PlyError> {
        let file = File::open(path).map_err(PlyError::io(path, "open"))?;
        let n_bytes = file.metadata().map_err(PlyError::io(path, "get the size"))?.len();
        let mut bytes = Vec::new();
        (&file).take(MAX_HEADER as u64).read_to_end(&mut bytes).map_err(PlyError::io(path, "read"))?;
        let start = header_len(&bytes, path)?;
        let head = parse_header(&bytes[..start], path)?;
        let vertex = head.elements.get("vertex").filter(|vertex| is_plain(&head, vertex));
        let Some(vertex) = vertex.filter(|_| head.encoding == Encoding::BinaryLittleEndian) else {
            return Err(PlyError::header(path, 1, HeaderFault::NotPlain));
        };
        let rows = plain_rows(&head, start, n_bytes as usize, path)?;
        let header = Header {
            comments: head.comments.clone(),
            infos: head.obj_infos.clone(),
            properties: scalar_properties(vertex),
        };
        Ok(Self { path: path.to_owned(), file, header, n_points: vertex.count, rows_at: rows.start as u64, n_bytes })
    }

    /// Metadata and columns.
    pub fn header(&self) -> &Header {
        &self.header
    }
    /// Number of points.
    pub fn len(&self) -> usize {
        self.n_points
    }
    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.n_points == 0
    }
    /// Size of the file, bytes.
    pub fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Fills `block` with packed rows, from row `first` on. Reading beyond the last row is an error, or returns other data of the
    /// file.
    pub fn read_into(&self, first: usize, block: &mut [u8]) -> Result<(), PlyError> {
        let at = self.rows_at + first as u64 * self.header.row_size() as u64;
        self.file.read_exact_at(block, at).map_err(PlyError::io(&self.path, "read"))
    }
}
