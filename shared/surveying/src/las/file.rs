//! Writing one LAS or LAZ file.

use super::header::HEADER_BYTES;
use super::record::position_of;
use super::vlr::Vlr;
use super::{FORMAT_7_BYTES, HeaderFacts, LasHeader};
use crate::error::DeliverError;
use files::atomic_file::AtomicFile;
use laz::{LasZipError, LazItemRecordBuilder, LazVlr, LazVlrBuilder, ParLasZipCompressor};
use std::fs::File;
use std::io::{self, BufWriter, Cursor, Seek, SeekFrom, Write};
use std::path::Path;

/// Number and bounds of points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Extent {
    pub(crate) n_points: u64,
    /// Smallest and largest stored coordinates; 0 without points.
    pub(crate) bounds: [[i32; 3]; 2],
}

impl Extent {
    /// Merges another extent into this one.
    pub(crate) fn join(&mut self, other: &Self) {
        if other.n_points == 0 {
            return;
        }
        if self.n_points == 0 {
            self.bounds = other.bounds;
        }
        self.n_points += other.n_points;
        for axis in 0..3 {
            self.bounds[0][axis] = self.bounds[0][axis].min(other.bounds[0][axis]);
            self.bounds[1][axis] = self.bounds[1][axis].max(other.bounds[1][axis]);
        }
    }
    /// Adds records.
    pub(crate) fn add(&mut self, records: &[u8], record_bytes: usize) {
        for record in records.chunks_exact(record_bytes) {
            let position = position_of(record);
            if self.n_points == 0 {
                self.bounds = [position; 2];
            }
            self.n_points += 1;
            let [low, high] = &mut self.bounds;
            for ((low, high), value) in low.iter_mut().zip(high).zip(position) {
                *low = (*low).min(value);
                *high = (*high).max(value);
            }
        }
    }
}

/// Records compressed as one chunk.
pub(crate) fn compressed_chunk(records: &[u8], vlr: &LazVlr) -> Result<Vec<u8>, LasZipError> {
    let mut whole = Cursor::new(Vec::new());
    laz::compress_buffer(&mut whole, records, vlr.clone())?;
    // Offset of the chunk table, then the chunk, then the table.
    let mut bytes = whole.into_inner();
    let table_at = bytes.first_chunk().map_or(0, |place| u64::from_le_bytes(*place)) as usize;
    bytes.truncate(table_at);
    bytes.drain(..8);
    Ok(bytes)
}

/// A file that gets its final name when it is complete.
pub(crate) struct LasFile<'a> {
    file: AtomicFile,
    facts: &'a HeaderFacts,
    header: LasHeader,
    extent: Extent,
    body: Body,
}

enum Body {
    Plain(BufWriter<File>),
    Compressed(Box<ParLasZipCompressor<BufWriter<File>>>),
}

/// How the records of point format 7 are compressed: in chunks of 50 000, or in chunks of their own sizes.
pub(crate) fn laz_vlr(record_bytes: usize, has_fixed_chunks: bool) -> LazVlr {
    let n_extra = (record_bytes - FORMAT_7_BYTES) as u16;
    let items = LazItemRecordBuilder::default_for_point_format_id(7, n_extra).expect("format 7 is known");
    let builder = LazVlrBuilder::new(items);
    if has_fixed_chunks { builder.build() } else { builder.with_variable_chunk_size().build() }
}

/// The cause of an error of the compressor.
pub(crate) fn io_error(error: LasZipError) -> io::Error {
    match error {
        LasZipError::IoError(cause) => cause,
        other => io::Error::other(other.to_string()),
    }
}

impl<'a> LasFile<'a> {
    /// Creates `path`, compressed as LAZ or not.
    pub(crate) fn create(
        path: &Path,
        facts: &'a HeaderFacts,
        vlrs: &[Vlr],
        is_compressed: bool,
    ) -> Result<Self, DeliverError> {
        let fault = DeliverError::file(path, "create");
        let file = AtomicFile::create(path);
        let (file, handle) = match file.and_then(|file| file.file().try_clone().map(|handle| (file, handle))) {
            Ok(opened) => opened,
            Err(error) => return Err(fault(error)),
        };
        let compression = is_compressed.then(|| laz_vlr(facts.record_bytes, true));
        let laszip = compression.as_ref().map(Vlr::laszip);
        let vlr_bytes: Vec<u8> = vlrs.iter().chain(&laszip).flat_map(Vlr::bytes).collect();
        let header = LasHeader {
            points_at: (HEADER_BYTES + vlr_bytes.len()) as u32,
            n_vlrs: (vlrs.len() + laszip.iter().len()) as u32,
            is_compressed,
            evlrs: (0, 0),
            n_points: 0,
            bounds: [[0; 3]; 2],
        };
        let mut writer = BufWriter::with_capacity(1 << 20, handle);
        let begin = writer.write_all(&[0; HEADER_BYTES]).and_then(|()| writer.write_all(&vlr_bytes));
        begin.map_err(DeliverError::file(path, "write"))?;
        let body = match compression {
            None => Body::Plain(writer),
            Some(vlr) => Body::Compressed(Box::new(
                ParLasZipCompressor::new(writer, vlr).map_err(io_error).map_err(DeliverError::file(path, "write"))?,
            )),
        };
        Ok(Self { file, facts, header, extent: Extent::default(), body })
    }

    /// Appends records. The chunks of one call are compressed in parallel; their bytes do not depend on how records are
    /// split into calls.
    pub(crate) fn write(&mut self, records: &[u8]) -> Result<(), DeliverError> {
        self.extent.add(records, self.facts.record_bytes);
        let written = match &mut self.body {
            Body::Plain(writer) => writer.write_all(records),
            Body::Compressed(compressor) => compressor.compress_many(records),
        };
        written.map_err(DeliverError::file(self.file.path(), "write"))
    }

    /// Completes the file and gives it its final name.
    pub(crate) fn finish(mut self) -> Result<Extent, DeliverError> {
        self.header.n_points = self.extent.n_points;
        self.header.bounds = self.extent.bounds;
        let header = self.header.bytes(self.facts);
        let path = self.file.path().to_owned();
        let write = || -> io::Result<()> {
            let mut writer = match self.body {
                Body::Plain(writer) => writer,
                Body::Compressed(mut compressor) => {
                    compressor.done().map_err(io_error)?;
                    compressor.into_inner()
                }
            };
            writer.seek(SeekFrom::Start(0))?;
            writer.write_all(&header)?;
            writer.flush()?;
            self.file.commit_unsynced()
        };
        write().map_err(DeliverError::file(&path, "write"))?;
        Ok(self.extent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(record_bytes: usize) -> HeaderFacts {
        let system = "system".to_owned();
        let software = "software".to_owned();
        HeaderFacts { system, software, begin_nanos: 0, offset_m: [0.0; 3], record_bytes }
    }

    /// Records of 40 bytes with increasing coordinates.
    fn records(n: usize) -> Vec<u8> {
        let mut bytes = vec![0; n * 40];
        for (i, record) in bytes.chunks_exact_mut(40).enumerate() {
            record[..4].copy_from_slice(&(i as i32 * 3 - 7).to_le_bytes());
            record[14] = 0x11;
            record[36..40].copy_from_slice(&(i as u32).to_le_bytes());
        }
        bytes
    }

    #[test]
    fn bytes_do_not_depend_on_threads_or_blocks() {
        let folder = tempfile::tempdir().expect("a folder");
        let records = records(120_000);
        let write = |n_threads: usize, block: usize| {
            let path = folder.path().join("a.laz");
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
            let extent = pool.install(|| {
                let facts = facts(40);
                let mut file = LasFile::create(&path, &facts, &[Vlr::class_names()], true).expect("creates");
                records.chunks(block * 40).for_each(|block| file.write(block).expect("writes"));
                file.finish().expect("finishes")
            });
            assert_eq!(extent, Extent { n_points: 120_000, bounds: [[-7, 0, 0], [359_990, 0, 0]] });
            std::fs::read(&path).expect("is there")
        };
        let one = write(1, 120_000);
        assert!(one.len() < records.len() / 2, "{} bytes are compressed", one.len());
        assert_eq!(one, write(3, 120_000));
        assert_eq!(one, write(2, 777));
    }

    #[test]
    fn unfinished_file_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let facts = facts(40);
        let mut file = LasFile::create(&folder.path().join("a.las"), &facts, &[], false).expect("creates");
        file.write(&records(10)).expect("writes");
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).expect("lists").count(), 0);
    }
}
