//! The file: header, description of the octree, nodes as chunks of LAZ, table of the nodes.

use super::octree::{NodeKey, Octree};
use crate::cloud_delivery::{CloudDelivery, metres};
use crate::error::DeliverError;
use crate::las::{
    Extent, HEADER_BYTES, HeaderFacts, LasHeader, SCALE_M, Vlr, compressed_chunk, evlr_bytes, gps_time_of, io_error,
    laz_vlr,
};
use crate::spool::Spool;
use files::atomic_file::AtomicFile;
use laz::LazVlr;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

/// Points of nodes that are compressed in parallel.
const POINTS_AT_A_TIME: u64 = 1 << 19;
/// Bytes of the description of the octree.
const INFO_BYTES: usize = 160;
/// Bytes of the offset of the chunk table, before the first chunk.
const TABLE_PLACE_BYTES: u64 = 8;

/// A node in the file.
struct Entry {
    key: NodeKey,
    at: u64,
    n_bytes: usize,
    n_points: usize,
}

/// Writes the nodes of `merged`, each with the points of its keys in `spool`.
pub(super) fn write(
    path: &Path,
    delivery: &CloudDelivery<'_>,
    octree: &Octree,
    spool: &Spool<NodeKey>,
    merged: &BTreeMap<NodeKey, Vec<NodeKey>>,
    mut progress: impl FnMut(u64),
) -> Result<Extent, DeliverError> {
    let facts = &delivery.facts;
    let laz = laz_vlr(facts.record_bytes, false);
    let file = AtomicFile::create(path).map_err(DeliverError::file(path, "create"))?;
    let mut writer = CopcWriter::begin(&file, delivery, &laz).map_err(DeliverError::file(path, "write"))?;
    let nodes: Vec<(&NodeKey, &Vec<NodeKey>)> = merged.iter().collect();
    let sizes: BTreeMap<NodeKey, u64> = spool.keys().into_iter().map(|records| (records.key, records.n)).collect();
    let n_points = |(_, keys): &(&NodeKey, &Vec<NodeKey>)| keys.iter().map(|key| sizes[key]).sum::<u64>();
    let mut rest = &nodes[..];
    while !rest.is_empty() {
        let mut n = 0;
        let mut n_batch = 0;
        while n < rest.len() && (n == 0 || n_batch < POINTS_AT_A_TIME) {
            n_batch += n_points(&rest[n]);
            n += 1;
        }
        let (batch, later) = rest.split_at(n);
        rest = later;
        let chunks: Result<Vec<Chunk>, DeliverError> = batch
            .par_iter()
            .map(|(key, keys)| {
                let mut records = Vec::new();
                for key in *keys {
                    spool.each_piece(key, usize::MAX, |piece| {
                        records.extend_from_slice(piece);
                        Ok(())
                    })?;
                }
                Chunk::compress(**key, &records, &laz).map_err(DeliverError::file(path, "write"))
            })
            .collect();
        chunks?.iter().try_for_each(|chunk| writer.add(chunk)).map_err(DeliverError::file(path, "write"))?;
        progress(n_batch);
    }
    let facts = &delivery.facts;
    let offset_m = delivery.facts.offset_m;
    let extent = writer.finish(facts, octree, &laz, offset_m).map_err(DeliverError::file(path, "write"))?;
    file.commit_unsynced().map_err(DeliverError::file(path, "write"))?;
    Ok(extent)
}

/// A compressed node.
struct Chunk {
    key: NodeKey,
    bytes: Vec<u8>,
    extent: Extent,
    /// Smallest and largest GPS time.
    times_s: [f64; 2],
}

impl Chunk {
    fn compress(key: NodeKey, records: &[u8], laz: &LazVlr) -> io::Result<Self> {
        let record_bytes = laz.items_size() as usize;
        let mut extent = Extent::default();
        extent.add(records, record_bytes);
        let times = records.chunks_exact(record_bytes).map(gps_time_of);
        let times_s = times.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], time| [a.min(time), b.max(time)]);
        Ok(Self { key, bytes: compressed_chunk(records, laz).map_err(io_error)?, extent, times_s })
    }
}

struct CopcWriter<'a> {
    writer: BufWriter<&'a std::fs::File>,
    /// Records before the points, without the description of the octree, which is the first.
    vlr_bytes: Vec<u8>,
    n_vlrs: u32,
    /// Offset of the next chunk.
    at: u64,
    table: ChunkTable,
    entries: Vec<Entry>,
    extent: Extent,
    times_s: [f64; 2],
}

impl<'a> CopcWriter<'a> {
    fn begin(file: &'a AtomicFile, delivery: &CloudDelivery<'_>, laz: &LazVlr) -> io::Result<Self> {
        let laszip = Vlr::laszip(laz);
        let vlr_bytes: Vec<u8> = delivery.vlrs.iter().chain([&laszip]).flat_map(Vlr::bytes).collect();
        let mut this = Self {
            writer: BufWriter::with_capacity(1 << 20, file.file()),
            n_vlrs: delivery.vlrs.len() as u32 + 2,
            vlr_bytes,
            at: 0,
            table: ChunkTable::default(),
            entries: Vec::new(),
            extent: Extent::default(),
            times_s: [f64::INFINITY, f64::NEG_INFINITY],
        };
        this.at = this.points_at() + TABLE_PLACE_BYTES;
        this.writer.write_all(&vec![0; this.at as usize])?;
        Ok(this)
    }

    fn points_at(&self) -> u64 {
        (HEADER_BYTES + info_vlr(Vec::from([0; INFO_BYTES])).len() + self.vlr_bytes.len()) as u64
    }

    fn add(&mut self, chunk: &Chunk) -> io::Result<()> {
        self.writer.write_all(&chunk.bytes)?;
        let n_bytes = chunk.bytes.len();
        let n_points = chunk.extent.n_points as usize;
        self.entries.push(Entry { key: chunk.key, at: self.at, n_bytes, n_points });
        self.table.push(ChunkTableEntry { point_count: chunk.extent.n_points, byte_count: n_bytes as u64 });
        self.at += n_bytes as u64;
        self.extent.join(&chunk.extent);
        self.times_s = [self.times_s[0].min(chunk.times_s[0]), self.times_s[1].max(chunk.times_s[1])];
        Ok(())
    }

    fn finish(mut self, facts: &HeaderFacts, octree: &Octree, laz: &LazVlr, offset_m: [f64; 3]) -> io::Result<Extent> {
        let points_at = self.points_at();
        let table_at = self.at;
        let mut table = Vec::new();
        self.table.write_to(&mut table, laz)?;
        self.writer.write_all(&table)?;
        let evlr_at = table_at + table.len() as u64;
        let hierarchy: Vec<u8> = self.entries.iter().flat_map(Entry::bytes).collect();
        let evlr = evlr_bytes("copc", 1000, "EPT hierarchy", &hierarchy);
        self.writer.write_all(&evlr)?;
        let header = LasHeader {
            points_at: points_at as u32,
            n_vlrs: self.n_vlrs,
            is_compressed: true,
            evlrs: (evlr_at, 1),
            n_points: self.extent.n_points,
            bounds: self.extent.bounds,
        };
        let place = HierarchyPlace { at: evlr_at + (evlr.len() - hierarchy.len()) as u64, n_bytes: hierarchy.len() };
        let info = info(octree, offset_m, &place, self.times_s);
        self.writer.seek(SeekFrom::Start(0))?;
        self.writer.write_all(&header.bytes(facts))?;
        self.writer.write_all(&info_vlr(info))?;
        self.writer.write_all(&self.vlr_bytes)?;
        self.writer.write_all(&table_at.to_le_bytes())?;
        self.writer.flush()?;
        Ok(self.extent)
    }
}

impl Entry {
    /// 32 bytes: level and cell, offset and size of the chunk, number of points.
    fn bytes(&self) -> Vec<u8> {
        let cell = self.key.cell.map(|cell| cell as i32);
        let mut bytes: Vec<u8> = [self.key.level as i32].into_iter().chain(cell).flat_map(i32::to_le_bytes).collect();
        bytes.extend(self.at.to_le_bytes());
        bytes.extend((self.n_bytes as i32).to_le_bytes());
        bytes.extend((self.n_points as i32).to_le_bytes());
        bytes
    }
}

fn info_vlr(data: Vec<u8>) -> Vec<u8> {
    Vlr { user: "copc", id: 1, description: "copc info", data }.bytes()
}

/// The hierarchy in the file.
struct HierarchyPlace {
    at: u64,
    n_bytes: usize,
}

/// Center and half side of the root, its spacing; offset and size of the hierarchy; smallest and largest time.
fn info(octree: &Octree, offset_m: [f64; 3], hierarchy: &HierarchyPlace, times_s: [f64; 2]) -> Vec<u8> {
    let side_m = (1_u64 << octree.side_bits) as f64 * SCALE_M;
    let low = metres(octree.low, offset_m);
    let doubles = low.map(|value| value + side_m / 2.0).into_iter().chain([side_m / 2.0, side_m / 128.0]);
    let mut bytes: Vec<u8> = doubles.flat_map(f64::to_le_bytes).collect();
    bytes.extend(hierarchy.at.to_le_bytes());
    bytes.extend((hierarchy.n_bytes as u64).to_le_bytes());
    bytes.extend(times_s.map(|time| if time.is_finite() { time } else { 0.0 }).into_iter().flat_map(f64::to_le_bytes));
    bytes.resize(INFO_BYTES, 0);
    bytes
}
