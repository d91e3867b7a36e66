//! Reading clouds block by block.

use super::reader::{MAX_HEADER, header_len, is_plain, parse_header, plain_rows, scalar_properties};
use super::{Header, HeaderFault, PlyError, Vertices};
use files::regular_file;
use ply_rs::ply::Encoding;
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A cloud written by [`super::PlyWriter`]. Only the header is in memory; rows are read on demand, so clouds of any size
/// can be processed in bounded memory.
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
        let file = regular_file::open(path).map_err(PlyError::io(path, "open"))?;
        let n_bytes = file.metadata().map_err(PlyError::io(path, "get the size"))?.len();
        let mut bytes = Vec::new();
        (&file).take(MAX_HEADER as u64).read_to_end(&mut bytes).map_err(PlyError::io(path, "read"))?;
        let start = header_len(&bytes, path)?;
        let head = parse_header(&bytes[..start], path)?;
        let vertex = head.elements.get("vertex").filter(|vertex| is_plain(&head, vertex));
        let Some(vertex) = vertex.filter(|_| head.encoding == Encoding::BinaryLittleEndian) else {
            return Err(PlyError::header(path, 1, HeaderFault::NotPlain));
        };
        let rows = plain_rows(&head, "vertex", start, n_bytes as usize, path)?;
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
    /// The rows of these ranges, one after the other.
    pub fn select(&self, ranges: impl IntoIterator<Item = Range<usize>>) -> Result<Vertices, PlyError> {
        let row_size = self.header.row_size();
        let mut bytes = Vec::new();
        for range in ranges {
            let range = range.start.min(self.n_points)..range.end.min(self.n_points);
            let filled = bytes.len();
            bytes.resize(filled + range.len() * row_size, 0);
            self.read_into(range.start, &mut bytes[filled..])?;
        }
        Ok(Vertices::from_rows(&self.path, &self.header, bytes))
    }

    /// About every `step`-th row: the first of every `step` groups of `GROUP` neighboring rows, which are read together.
    pub fn thinned(&self, step: usize) -> Result<Vertices, PlyError> {
        let starts = (0..self.n_points).step_by(GROUP.saturating_mul(step.max(1)));
        self.select(starts.map(|start| start..start + GROUP))
    }
}

/// Rows that are read together by [`PlyRows::thinned`]: about a page of memory.
const GROUP: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ply::{Kind, PlyWriter, Row};

    #[test]
    fn thinned_cloud_has_evenly_spaced_groups_of_rows() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.ply");
        let header = Header::new([("x", Kind::Float), ("n", Kind::Int)]);
        let n_points = 10 * GROUP + 7;
        let mut writer = PlyWriter::create(&path, &header, n_points).expect("creates");
        let encode = |i: usize, row: &mut Row<'_>| {
            row.f32(0.5).i32(i as i32);
        };
        writer.write_each(n_points, encode).expect("writes");
        writer.finish().expect("finishes");
        let rows = PlyRows::open(&path).expect("opens");
        let numbers = |step: usize| rows.thinned(step).expect("reads").i64s("n").expect("has n");
        assert_eq!(numbers(1), (0..n_points as i64).collect::<Vec<_>>());
        let group = GROUP as i64;
        let expected: Vec<i64> =
            [0, 5, 10].iter().flat_map(|k| (k * group..(k + 1) * group).take_while(|n| *n < n_points as i64)).collect();
        assert_eq!(numbers(5), expected);
        let end = rows.select([3..5, 640..9999]).expect("reads").i64s("n").expect("has n");
        assert_eq!(end, [3, 4, 640, 641, 642, 643, 644, 645, 646]);
    }
}
