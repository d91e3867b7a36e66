//! The points of an unfinished run: a LAS file that grows by one part for each cloud that the run writes.

use crate::cloud::{Columns, ScanLine};
use crate::error::DeliverError;
use crate::las::{Extent, HEADER_BYTES, HeaderFacts, LasHeader, RecordLayout, RecordSource, Vlr, gps_time_of};
use delivery::is_in_odometry;
use formats::ply::PlyRows;
use messages::columns::COLUMNS;
use serde::Serialize;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Largest number of points taken from a cloud, evenly spread. A page with hundreds of clouds cannot draw more points of
/// each.
const MAX_POINTS: usize = 200_000;
/// The points of a part are written in this many passes, so that its first points are a thinned version of the whole
/// part.
const PASSES: [usize; 8] = [0, 4, 2, 6, 1, 5, 3, 7];

/// The growing file.
pub struct GrowingCloud {
    path: PathBuf,
    file: File,
    layout: RecordLayout,
    facts: HeaderFacts,
    header: LasHeader,
    extent: Extent,
    /// Offset of the next part.
    end: u64,
}

/// The points of one cloud in the file, and their extent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Number of the submap.
    pub seq: u64,
    /// First byte in the file.
    pub begin: u64,
    /// Number of points in the file.
    pub n_points: u64,
    /// Number of points of the cloud.
    pub n_all: u64,
    /// Smallest and largest coordinates, m.
    pub bounds: [[f64; 3]; 2],
    /// Smallest and largest GPS time, s.
    pub times_s: [f64; 2],
    /// Positions of the LiDAR, one for each sweep, m.
    pub path: Vec<[f64; 3]>,
}

impl GrowingCloud {
    /// Creates the file with the columns of the first cloud.
    pub fn create(path: &Path, first: &PlyRows, system: &str, software: &str) -> Result<Self, DeliverError> {
        let columns =
            Columns::from_header(first.header(), COLUMNS).map_err(|rule| DeliverError::content(path, rule))?;
        // The frame of the odometry starts at 0.
        let layout = RecordLayout::new(&columns.present(), &[], [0.0; 3]);
        let facts = HeaderFacts {
            system: system.to_owned(),
            software: software.to_owned(),
            begin_nanos: 0,
            offset_m: [0.0; 3],
            record_bytes: layout.n_bytes(),
        };
        let vlrs = [layout.extra.vlr(), Vlr::class_names()];
        let vlr_bytes: Vec<u8> = vlrs.iter().flat_map(Vlr::bytes).collect();
        let end = HEADER_BYTES + vlr_bytes.len();
        let header = LasHeader {
            points_at: end as u32,
            n_vlrs: vlrs.len() as u32,
            is_compressed: false,
            evlrs: (0, 0),
            n_points: 0,
            bounds: [[0; 3]; 2],
        };
        let file = File::create(path).map_err(DeliverError::file(path, "create"))?;
        file.write_all_at(&vlr_bytes, HEADER_BYTES as u64).map_err(DeliverError::file(path, "write"))?;
        let this =
            Self { path: path.to_owned(), file, layout, facts, header, extent: Extent::default(), end: end as u64 };
        this.write_header()?;
        Ok(this)
    }

    /// Appends up to 200 000 points of the cloud of a submap. `None` if the cloud is already in its final frame, which
    /// differs from the frame of the other parts, or has no points.
    pub fn add(&mut self, seq: u64, cloud: &PlyRows) -> Result<Option<Part>, DeliverError> {
        if !is_in_odometry(cloud.header()) {
            return Ok(None);
        }
        let columns =
            Columns::from_header(cloud.header(), COLUMNS).map_err(|rule| DeliverError::content(&self.path, rule))?;
        let SampledRows { rows, path } = sampled_rows(cloud, &columns)?;
        let records = self.records(seq, &rows, &columns, &path);
        let mut extent = Extent::default();
        extent.add(&records, self.facts.record_bytes);
        if extent.n_points == 0 {
            return Ok(None);
        }
        let fault = || DeliverError::file(&self.path, "write");
        self.file.write_all_at(&records, self.end).map_err(fault())?;
        let times = records.chunks_exact(self.facts.record_bytes).map(gps_time_of);
        let times_s = times.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], time| [a.min(time), b.max(time)]);
        let bounds = extent.bounds.map(|corner| crate::cloud_delivery::metres(corner, self.facts.offset_m));
        let begin = self.end;
        let n_all = cloud.len() as u64;
        self.end += records.len() as u64;
        self.extent.join(&extent);
        self.write_header()?;
        Ok(Some(Part { seq, begin, n_points: extent.n_points, n_all, bounds, times_s, path }))
    }

    /// Records of rows in the order of [`PASSES`].
    fn records(&self, seq: u64, rows: &[u8], columns: &Columns, path: &[[f64; 3]]) -> Vec<u8> {
        let n_bytes = self.facts.record_bytes;
        let source = u16::try_from(seq + 1).unwrap_or(u16::MAX);
        let forward = direction(path);
        let rows: Vec<&[u8]> = rows.chunks_exact(columns.row_size()).collect();
        let mut records = Vec::with_capacity(rows.len() * n_bytes);
        for row in PASSES.iter().flat_map(|pass| rows.iter().skip(*pass).step_by(PASSES.len())) {
            let point = columns.point(row);
            if let Some(stored) = self.layout.stored(point.xyz) {
                let at = records.len();
                records.resize(at + n_bytes, 0);
                let record_source =
                    RecordSource { point: &point, columns, row, stored, source, forward, spectrum: None };
                self.layout.encode(&record_source, &mut records[at..]);
            }
        }
        records
    }

    fn write_header(&self) -> Result<(), DeliverError> {
        let header = LasHeader { n_points: self.extent.n_points, bounds: self.extent.bounds, ..self.header };
        let fault = DeliverError::file(&self.path, "write");
        self.file.write_all_at(&header.bytes(&self.facts), 0).map_err(fault)
    }
}

/// A part of the points of a cloud.
struct SampledRows {
    /// Rows of evenly spread points.
    rows: Vec<u8>,
    /// A position of the LiDAR for each sweep.
    path: Vec<[f64; 3]>,
}

fn sampled_rows(cloud: &PlyRows, columns: &Columns) -> Result<SampledRows, DeliverError> {
    let step = cloud.len().div_ceil(MAX_POINTS).max(1);
    let row_size = columns.row_size();
    let block_points = step * 4096;
    let mut rows = Vec::new();
    let mut path = Vec::new();
    let mut last_frame = None;
    let mut block = Vec::new();
    for first in (0..cloud.len()).step_by(block_points) {
        block.resize(block_points.min(cloud.len() - first) * row_size, 0);
        cloud.read_into(first, &mut block)?;
        for row in block.chunks_exact(row_size).step_by(step) {
            rows.extend_from_slice(row);
            let ScanLine { frame, lidar, .. } = columns.scan_line(row);
            if lidar == 0 && last_frame.is_none_or(|last| frame > last) {
                last_frame = Some(frame);
                path.push(columns.point(row).lidar_xyz);
            }
        }
    }
    Ok(SampledRows { rows, path })
}

/// Horizontal direction from the first to the last position; the x axis if there is no direction.
fn direction(path: &[[f64; 3]]) -> [f64; 2] {
    let (Some([x0, y0, _]), Some([x1, y1, _])) = (path.first(), path.last()) else { return [1.0, 0.0] };
    let x = x1 - x0;
    let y = y1 - y0;
    let length = x.hypot(y);
    if length > 0.0 { [x / length, y / length] } else { [1.0, 0.0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::position_of;
    use formats::ply::{Header, Kind, PlyWriter};

    const NAMES: [&str; 6] = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];

    /// `n` points along x, 1 mm apart, starting at `from` m.
    fn cloud(path: &Path, info: &str, from: f64, n: usize) -> PlyRows {
        let header = Header::new(NAMES.map(|name| (name, Kind::Float)).into_iter().chain([
            ("timestamp", Kind::Double),
            ("index_frame", Kind::Int),
            ("intensity", Kind::UChar),
            ("ring", Kind::UChar),
            ("dynamic", Kind::UChar),
        ]));
        let mut writer = PlyWriter::create(path, &header.info(info), n).expect("creates");
        let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
            row.f32((from + i as f64 * 0.001) as f32).f32(0.0).f32(0.0).f32(0.0).f32((i / 100) as f32).f32(0.0);
            row.f64(1_726_230_400.0 + i as f64).i32((i / 100) as i32).u8(1).u8(2).u8(0);
        };
        let keep = |_: usize, _: &mut [u8]| Ok(());
        writer.write_amended(n, encode, keep).expect("writes");
        writer.finish_unsynced().expect("finishes");
        PlyRows::open(path).expect("opens")
    }

    #[test]
    fn parts_are_appended_and_their_first_points_are_spread() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("live.las");
        let first = cloud(&folder.path().join("a.ply"), "frame odometry, m", 0.0, 800);
        let mut growing = GrowingCloud::create(&path, &first, "system", "software").expect("creates");
        let a = growing.add(0, &first).expect("adds").expect("is in the frame");
        let second = cloud(&folder.path().join("b.ply"), "frame odometry, m", 1.0, 200);
        let b = growing.add(1, &second).expect("adds").expect("is in the frame");
        assert_eq!((a.n_points, b.n_points, a.path.len()), (800, 200, 8));
        let bytes = std::fs::read(&path).expect("reads");
        let n_bytes = growing.facts.record_bytes;
        assert_eq!(b.begin, a.begin + 800 * n_bytes as u64);
        assert_eq!(bytes.len() as u64, b.begin + 200 * n_bytes as u64);
        assert_eq!(bytes[247..255], 1000_u64.to_le_bytes(), "the header counts all points");
        let first_points: Vec<i32> =
            bytes[a.begin as usize..].chunks_exact(n_bytes).take(100).map(|record| position_of(record)[0]).collect();
        let gaps: Vec<i32> = first_points.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert_eq!(first_points.len(), 100);
        assert!(gaps.iter().all(|gap| *gap == 8), "every eighth point first: {gaps:?}");
    }

    #[test]
    fn cloud_in_its_final_frame_and_surplus_points_are_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = cloud(&folder.path().join("a.ply"), "frame odometry, m", 0.0, 500_000);
        let path = folder.path().join("live.las");
        let mut growing = GrowingCloud::create(&path, &first, "system", "software").expect("creates");
        let part = growing.add(0, &first).expect("adds").expect("is in the frame");
        assert_eq!((part.n_all, part.n_points), (500_000, 500_000_u64.div_ceil(3)));
        let placed = cloud(&folder.path().join("b.ply"), "frame local east-north-up, m", 0.0, 8);
        assert_eq!(growing.add(1, &placed).expect("reads"), None);
    }
}
