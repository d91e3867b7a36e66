//! LAS and LAZ point clouds (ASPRS LAS 1.0 to 1.4), read in blocks.

mod extra_bytes;
mod layers;

use crate::error::{At, ImportError};
use extra_bytes::ExtraField;
use files::regular_file;
use formats::cloud::CloudPoint;
use formats::cloud_fields::{Column, Field, PointFlags, RawCloud, ValueType};
use laz::{LasZipDecompressor, LazVlr};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Bytes of the header up to the offsets.
const HEADER_BYTES: usize = 227;
/// Bytes of points that are decoded at a time.
const BLOCK_BYTES: usize = 1 << 21;
/// Maximum number of points per byte of a compressed file. Real files have less than one.
const MAX_POINTS_PER_BYTE: u64 = 8;
/// Maximum number of bytes of points per byte of a compressed file. Real files have less than 100.
const MAX_BYTES_PER_BYTE: u64 = 512;
/// Longest compressed record, bytes: the decoder keeps 2.3 kB for each byte after the point.
const MAX_LAZ_RECORD: usize = 1024;
/// Bytes of a record before the time, by point format; `None` without time.
const TIME_AT: [Option<usize>; 11] =
    [None, Some(20), None, Some(20), Some(20), Some(20), Some(22), Some(22), Some(22), Some(22), Some(22)];

/// Bytes of a record without extra bytes, by point format.
const RECORD_BYTES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
/// First point format with 256 classes and a byte of flags.
const FIRST_LONG_FORMAT: u8 = 6;
/// Classes of noise: low noise, and high noise of LAS 1.4.
const NOISE: [u8; 2] = [7, 18];
/// Name of the times.
pub(crate) const GPS_TIME: &str = "GPS time";

/// A point and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LasPoint {
    /// Coordinates, m.
    pub position: [f64; 3],
    /// Intensity of 16 bits.
    pub intensity: u16,
    /// GPS time, s; `None` in point formats without time.
    pub time_s: Option<f64>,
    /// Number of the beam, from the extra bytes.
    pub beam: Option<f64>,
    /// Whether it is flagged as withheld: deleted without removing it from the file.
    is_withheld: bool,
    /// Whether it is classified as noise.
    is_noise: bool,
}

impl LasPoint {
    /// The point in single precision.
    pub fn point(&self) -> CloudPoint {
        let [x, y, z] = self.position.map(|value| value as f32);
        CloudPoint { x, y, z, intensity: f32::from(self.intensity) }
    }
}

/// The points of a file as columns.
pub(crate) fn raw_from_las(path: &Path) -> Result<RawCloud, ImportError> {
    let mut positions = Vec::new();
    let mut intensities = Vec::new();
    let mut times = Vec::new();
    let mut beams = Vec::new();
    let flags = each_block(path, |block| {
        for point in block {
            positions.push(point.position);
            intensities.push(f64::from(point.intensity));
            times.extend(point.time_s);
            beams.extend(point.beam);
        }
        Ok(())
    })?;
    let n = positions.len();
    let column = |name: &str, value_type: ValueType, values: Vec<f64>| {
        (values.len() == n && n > 0).then(|| Column { name: name.to_owned(), value_type, values })
    };
    Ok(RawCloud {
        positions,
        position_type: ValueType::F64,
        intensities: column(Field::Intensity.names()[0], ValueType::U16, intensities),
        beams: column(Field::Ring.names()[0], ValueType::U16, beams),
        times: column(GPS_TIME, ValueType::F64, times),
        viewpoint: None,
        flags,
    })
}

/// Content of the header.
#[derive(Debug)]
struct Layout {
    /// Size of the file.
    n_bytes: u64,
    /// Number of the point format, 0 to 10.
    format: u8,
    /// Minor version of the format LAS 1.
    minor: u8,
    data_at: u64,
    n_points: u64,
    record_bytes: usize,
    time_at: Option<usize>,
    /// The beam in the extra bytes.
    beam: Option<ExtraField>,
    scale: [f64; 3],
    offset: [f64; 3],
    /// Description of the compression.
    laszip: Option<Vec<u8>>,
}

/// Passes all points of a file to `take`, block by block, except for withheld ones. Returns the numbers of flagged points.
pub(crate) fn each_block(
    path: &Path,
    mut take: impl FnMut(&[LasPoint]) -> Result<(), ImportError>,
) -> Result<PointFlags, ImportError> {
    let file = regular_file::open(path).at(path)?;
    let n_bytes = file.metadata().at(path)?.len();
    let mut file = BufReader::new(file);
    let layout = Layout::read(&mut file, n_bytes).map_err(|rule| ImportError::at(path, rule))?;
    // A record has less than 2^16 bytes.
    let block_points = ((BLOCK_BYTES / layout.record_bytes) as u64).min(layout.n_points) as usize;
    let mut bytes = vec![0; block_points * layout.record_bytes];
    let mut decompressor = match &layout.laszip {
        None => {
            file.seek(SeekFrom::Start(layout.data_at)).at(path)?;
            None
        }
        Some(vlr) => Some(decompressor(&layout, vlr, path)?),
    };
    let mut flags = PointFlags { n_points: layout.n_points, ..PointFlags::default() };
    let mut left = layout.n_points;
    while left > 0 {
        let n = (block_points as u64).min(left) as usize;
        let block = &mut bytes[..n * layout.record_bytes];
        match &mut decompressor {
            None => file.read_exact(block).at(path)?,
            Some(decompressor) => guarded(|| decompressor.decompress_many(block), path)?.at(path)?,
        }
        let mut points: Vec<LasPoint> =
            block.chunks_exact(layout.record_bytes).map(|record| layout.point(record)).collect();
        points.retain(|point| !point.is_withheld);
        flags.n_withheld += n as u64 - points.len() as u64;
        flags.n_noise += points.iter().filter(|point| point.is_noise).count() as u64;
        take(&points)?;
        left -= n as u64;
    }
    Ok(flags)
}

/// Calls the decoder, which panics on some damaged files.
fn guarded<T>(decode: impl FnOnce() -> T, path: &Path) -> Result<T, ImportError> {
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    decoded.map_err(|_| ImportError::at(path, "the decoder cannot handle the damage of the file"))
}

fn decompressor(
    layout: &Layout,
    bytes: &[u8],
    path: &Path,
) -> Result<LasZipDecompressor<'static, BufReader<File>>, ImportError> {
    let vlr = LazVlr::from_buffer(bytes).at(path)?;
    if vlr.items_size() != layout.record_bytes as u64 {
        let rule = format!("compressed records of {} bytes, the header says {}", vlr.items_size(), layout.record_bytes);
        return Err(ImportError::at(path, rule));
    }
    let mut source = BufReader::new(regular_file::open(path).at(path)?);
    let Layout { data_at, n_points, n_bytes, .. } = *layout;
    let fault = |rule: String| ImportError::at(path, rule);
    let in_layers = layers::are_layers(bytes, &vlr).map_err(fault)?;
    if in_layers != (layout.format > 5) {
        let as_formats = if in_layers { "6 to 10" } else { "0 to 5" };
        return Err(fault(format!("point format {}, but compressed as {as_formats}", layout.format)));
    }
    if in_layers {
        guarded(|| layers::check(&mut source, &vlr, data_at, n_bytes, n_points), path)?.map_err(fault)?;
    }
    source.seek(SeekFrom::Start(data_at)).at(path)?;
    guarded(move || LasZipDecompressor::new(source, vlr), path)?.at(path)
}

impl Layout {
    fn read(file: &mut BufReader<File>, n_bytes: u64) -> Result<Self, String> {
        let mut header = [0; HEADER_BYTES];
        let read = file.read_exact(&mut header);
        if read.is_err() || !header.starts_with(b"LASF") {
            return Err("is not a LAS file: it does not begin with the header of one".into());
        }
        let header_bytes = u64::from(u16_at(&header, 94));
        let data_at = u64::from(u32_at(&header, 96));
        let format = header[104] & 0x3f;
        let record_bytes = usize::from(u16_at(&header, 105));
        let is_compressed = header[104] & 0x80 != 0;
        let mut n_points = u64::from(u32_at(&header, 107));
        if n_points == 0 && header_bytes >= 375 {
            let mut long = [0; 8];
            file.seek(SeekFrom::Start(247))
                .and_then(|_| file.read_exact(&mut long))
                .map_err(|error| error.to_string())?;
            n_points = u64::from_le_bytes(long);
        }
        let time_at =
            *TIME_AT.get(usize::from(format)).ok_or_else(|| format!("point format {format} must be 0 to 10"))?;
        let least = RECORD_BYTES[usize::from(format)];
        if record_bytes < least {
            return Err(format!("records of {record_bytes} bytes; point format {format} has at least {least}"));
        }
        if is_compressed && record_bytes > MAX_LAZ_RECORD {
            return Err(format!("compressed records of {record_bytes} bytes; at most {MAX_LAZ_RECORD} are read"));
        }
        let room = if is_compressed {
            let by_bytes = MAX_BYTES_PER_BYTE / record_bytes as u64;
            n_bytes.saturating_mul(by_bytes.clamp(1, MAX_POINTS_PER_BYTE))
        } else {
            n_bytes.saturating_sub(data_at) / record_bytes as u64
        };
        if n_points > room {
            return Err(format!(
                "{n_points} points of {record_bytes} bytes; {n_bytes} bytes of the file cannot hold them"
            ));
        }
        let triple = |at: usize| [at, at + 8, at + 16].map(|at| f64_at(&header, at));
        let scale = triple(131);
        let offset = triple(155);
        if !scale.iter().chain(&offset).all(|value| value.is_finite()) {
            return Err(format!("scale {scale:?} and offset {offset:?} must be finite"));
        }
        if let Some(axis) = scale.iter().position(|scale| *scale == 0.0) {
            let axis = ["x", "y", "z"][axis];
            return Err(format!("the scale of {axis} is 0: all points have the same {axis}; write the file again"));
        }
        let beam = extra_bytes::beam(&mut *file, &header, RECORD_BYTES[usize::from(format)])
            .map_err(|error| error.to_string())?;
        let beam = beam.filter(|beam| beam.end() <= record_bytes);
        let mut layout = Self {
            n_bytes,
            format,
            minor: header[25],
            data_at,
            n_points,
            record_bytes,
            time_at,
            beam,
            scale,
            offset,
            laszip: None,
        };
        if !is_compressed {
            layout.check_count(file, &header)?;
        }
        if is_compressed {
            layout.laszip = Some(laszip(file, header_bytes, u32_at(&header, 100), data_at)?);
            layout.check_chunks(file)?;
        }
        Ok(layout)
    }

    /// Fails if the file holds more points than its header states.
    fn check_count(&self, file: &mut BufReader<File>, header: &[u8]) -> Result<(), String> {
        let header_bytes = u16_at(header, 94);
        // Waveforms and extended records follow the points.
        let mut end = self.n_bytes;
        for (at, least) in [(227, 235), (235, 375)] {
            if header_bytes >= least {
                let mut long = [0; 8];
                file.seek(SeekFrom::Start(at))
                    .and_then(|_| file.read_exact(&mut long))
                    .map_err(|error| error.to_string())?;
                let next = u64::from_le_bytes(long);
                end = if next > self.data_at { end.min(next) } else { end };
            }
        }
        let room = end.saturating_sub(self.data_at) / self.record_bytes as u64;
        if room > self.n_points {
            return Err(format!(
                "the header states {} points of {} bytes; the file holds {room}: the header contradicts the data",
                self.n_points, self.record_bytes
            ));
        }
        Ok(())
    }

    /// Checks the number of chunks: the decoder reserves memory for as many chunks as the file states.
    fn check_chunks(&self, file: &mut BufReader<File>) -> Result<(), String> {
        let n_bytes = self.n_bytes;
        let mut long = [0; 8];
        let mut number_at = |at: u64| -> Result<[u8; 8], String> {
            file.seek(SeekFrom::Start(at))
                .and_then(|_| file.read_exact(&mut long))
                .map_err(|error| error.to_string())?;
            Ok(long)
        };
        // Writers that cannot seek write -1 there, and the position to the end. The decoder treats every position before
        // the points like this.
        let is_place = |at: i64| u64::try_from(at).is_ok_and(|at| at > self.data_at);
        let mut table_at = i64::from_le_bytes(number_at(self.data_at)?);
        if !is_place(table_at) {
            table_at = i64::from_le_bytes(number_at(n_bytes.saturating_sub(8))?);
        }
        let Some(table_at) =
            u64::try_from(table_at).ok().filter(|at| *at > self.data_at && at.saturating_add(8) <= n_bytes)
        else {
            return Err(format!(
                "the table of the chunks begins at byte {table_at}; the file has {n_bytes}: it is cut"
            ));
        };
        let [.., a, b, c, d] = number_at(table_at)?;
        let n_chunks = u64::from(u32::from_le_bytes([a, b, c, d]));
        if n_chunks > self.n_points {
            return Err(format!("{n_chunks} chunks for {} points", self.n_points));
        }
        Ok(())
    }

    fn point(&self, record: &[u8]) -> LasPoint {
        let value = |k: usize| f64::from(u32_at(record, 4 * k) as i32) * self.scale[k] + self.offset[k];
        let (class, is_withheld) = if self.format >= FIRST_LONG_FORMAT {
            (record[16], record[15] & 0x04 != 0)
        } else {
            // LAS 1.0 has no flags in this byte.
            (record[15] & 0x1f, self.minor > 0 && record[15] & 0x80 != 0)
        };
        LasPoint {
            is_withheld,
            is_noise: NOISE.contains(&class),
            position: [value(0), value(1), value(2)],
            intensity: u16_at(record, 12),
            time_s: self.time_at.map(|at| f64_at(record, at)),
            beam: self.beam.map(|beam| beam.value(record)),
        }
    }
}

/// The description of the compression among the variable length records.
fn laszip(file: &mut BufReader<File>, header_bytes: u64, n_records: u32, data_at: u64) -> Result<Vec<u8>, String> {
    let mut at = header_bytes;
    for _ in 0..n_records {
        let mut head = [0; 54];
        if at + 54 > data_at {
            break;
        }
        file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut head)).map_err(|error| error.to_string())?;
        let length = usize::from(u16_at(&head, 20));
        if head[2..18].starts_with(b"laszip encoded") && u16_at(&head, 18) == 22_204 {
            let mut data = vec![0; length];
            file.read_exact(&mut data).map_err(|error| error.to_string())?;
            return Ok(data);
        }
        at += 54 + length as u64;
    }
    Err("is compressed, but has no record \"laszip encoded\"".into())
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    let mut long = [0; 8];
    long.copy_from_slice(&bytes[at..at + 8]);
    f64::from_le_bytes(long)
}
