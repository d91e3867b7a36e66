//! The points of a run as LAS or LAZ: one pass over the clouds encodes records, a second one writes the files.

use crate::cloud::{self, Cloud, Columns, ScanLine, Spectra};
use crate::crs::CrsError;
use crate::error::DeliverError;
use crate::las::{HeaderFacts, RecordLayout, RecordSource, SCALE_M, Vlr, withhold};
use crate::path_heading::PathHeading;
use crate::run_folder::RunFolder;
use crate::spool::Spool;
use crate::static_world::StaticWorld;
use crate::target_frame::TargetFrame;
use messages::columns::COLUMNS;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// Points that a thread encodes at a time. Their indices fit in 16 bits.
const PART_POINTS: usize = 1 << 16;
/// The offset of the coordinates is a multiple of this, m.
const OFFSET_STEP_M: f64 = 1000.0;

/// What the files of the points contain.
#[derive(Clone, Debug)]
pub struct CloudOptions {
    /// Whether records include the reflectances of bands.
    pub has_bands: bool,
    /// `system identifier` of the headers: the system that recorded the points, up to 32 characters.
    pub system: String,
    /// `generating software` of the headers, up to 32 characters.
    pub software: String,
    /// Whether all kinds of ground, roads included, have the class 2 (ground) of the ASPRS.
    pub has_ground_as_2: bool,
    /// Note for readers of the file, such as a warning that the coordinates are not georeferenced. Empty = no note.
    pub note: String,
}

/// Points that are missing in the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Points of clouds that stayed in the frame of the odometry.
    pub without_place: u64,
    /// Points whose coordinates are NaN or infinite.
    pub not_finite: u64,
}

/// Reads the clouds of runs as records.
pub(crate) struct CloudDelivery<'a> {
    runs: &'a [RunFolder],
    frame: &'a TargetFrame<'a>,
    clouds: Vec<Cloud<'a>>,
    bands: Vec<String>,
    pub(crate) layout: RecordLayout,
    pub(crate) facts: HeaderFacts,
    pub(crate) vlrs: Vec<Vlr>,
    pub(crate) left_out: LeftOut,
    /// Points that this world removes are marked as withheld.
    pub(crate) withholds: Option<&'a dyn StaticWorld>,
}

impl<'a> CloudDelivery<'a> {
    pub(crate) fn new(
        runs: &'a [RunFolder],
        frame: &'a TargetFrame<'a>,
        options: &CloudOptions,
    ) -> Result<Self, DeliverError> {
        let cloud::OpenedClouds { clouds, n_left_out: without_place } = cloud::open_all(runs)?;
        let bands = if options.has_bands { cloud::band_names(runs)? } else { Vec::new() };
        let offset_m = offset(&clouds, frame)?;
        let table = runs.first().map_or(COLUMNS, |run| run.columns);
        let layout = RecordLayout::new(&cloud::present(table, &clouds), &bands, offset_m);
        let layout = if options.has_ground_as_2 { layout.with_ground_as_2() } else { layout };
        let facts = HeaderFacts {
            system: options.system.clone(),
            software: options.software.clone(),
            begin_nanos: runs.iter().filter_map(RunFolder::begin_nanos).min().unwrap_or(0),
            offset_m,
            record_bytes: layout.n_bytes(),
        };
        let text = format!("{}\n{}", frame.description(), options.note);
        let vlrs = frame.wkt().as_deref().map(Vlr::wkt).into_iter();
        let vlrs = vlrs.chain([Vlr::text(text.trim_end()), layout.extra.vlr(), Vlr::class_names()]).collect();
        let left_out = LeftOut { without_place, not_finite: 0 };
        Ok(Self { runs, frame, clouds, bands, layout, facts, vlrs, left_out, withholds: None })
    }

    /// Encodes all points into a spool in `folder`, by the key of their stored coordinates.
    pub(crate) fn spool<K: Ord + Copy + Send>(
        &mut self,
        folder: &Path,
        key_of: impl Fn([i32; 3]) -> K + Sync,
        mut progress: impl FnMut(u64),
    ) -> Result<Spool<K>, DeliverError> {
        let headings = self.runs.iter().map(|run| (run.path(), PathHeading::new(&run.trajectory, run.convergence())));
        let headings: BTreeMap<&Path, PathHeading> = headings.collect();
        let mut spool = Spool::create(folder, self.layout.n_bytes())?;
        let mut not_finite = 0;
        for cloud in &self.clouds {
            let spectra = Spectra::load(cloud, &self.bands)?;
            let heading = &headings[cloud.run.path()];
            cloud.each_block(|first, rows| {
                let encoder = Encoder { delivery: self, cloud, spectra: &spectra, heading };
                let n_rows = rows.len() / cloud.columns.row_size();
                not_finite += n_rows as u64;
                for Part { records, keys } in encoder.block(first, rows, &key_of)? {
                    not_finite -= keys.len() as u64;
                    spool.add(&records, &keys)?;
                }
                progress(n_rows as u64);
                Ok(())
            })?;
        }
        self.left_out.not_finite = not_finite;
        Ok(spool)
    }
}

/// Offset of the coordinates: near the first cloud with points, so that stored coordinates are small.
fn offset(clouds: &[Cloud<'_>], frame: &TargetFrame<'_>) -> Result<[f64; 3], CrsError> {
    let Some([low, high]) = clouds.iter().find_map(|cloud| cloud.entry.bounds) else { return Ok([0.0; 3]) };
    let middle = std::array::from_fn(|axis| f64::midpoint(low[axis], high[axis]));
    if middle.iter().any(|value: &f64| !value.is_finite()) {
        return Ok([0.0; 3]);
    }
    let [x, y, _] = frame.from_cloud(middle)?;
    let floor = |value: f64| (value / OFFSET_STEP_M).floor() * OFFSET_STEP_M;
    Ok([floor(x), floor(y), 0.0])
}

/// Encodes the blocks of a cloud.
struct Encoder<'a> {
    delivery: &'a CloudDelivery<'a>,
    cloud: &'a Cloud<'a>,
    spectra: &'a Spectra,
    heading: &'a PathHeading,
}

/// Records, and the key of each.
struct Part<K> {
    records: Vec<u8>,
    keys: Vec<K>,
}

impl Encoder<'_> {
    /// Records and keys of the points with finite coordinates, part by part.
    fn block<K: Send>(
        &self,
        first: usize,
        rows: &[u8],
        key_of: &(impl Fn([i32; 3]) -> K + Sync),
    ) -> Result<Vec<Part<K>>, CrsError> {
        let parts = rows.par_chunks(PART_POINTS * self.cloud.columns.row_size()).enumerate();
        parts.map(|(part, rows)| self.part(first + part * PART_POINTS, rows, key_of)).collect()
    }

    fn part<K>(&self, first: usize, rows: &[u8], key_of: impl Fn([i32; 3]) -> K) -> Result<Part<K>, CrsError> {
        let Self { delivery, cloud, .. } = self;
        let row_size = cloud.columns.row_size();
        let n_bytes = delivery.layout.n_bytes();
        // 0 means that the source is unknown.
        let number = cloud.run.survey_drive.unwrap_or(cloud.entry.seq) + 1;
        let source = u16::try_from(number).unwrap_or(u16::MAX);
        let n = rows.len() / row_size;
        let mut records = vec![0; n * n_bytes];
        let mut keys = Vec::with_capacity(n);
        let run = cloud.run.survey_drive.unwrap_or(0) as usize;
        let mut converter = delivery.frame.converter();
        let mut near = 0;
        for i in scan_line_order(&cloud.columns, rows) {
            let row = &rows[i * row_size..][..row_size];
            let point = cloud.columns.point(row);
            if point.xyz.iter().any(|value| !value.is_finite()) {
                continue;
            }
            let Some(stored) = delivery.layout.stored(converter.convert(point.xyz)?) else { continue };
            let forward = self.heading.at(point.time_s, &mut near);
            let spectrum = if delivery.bands.is_empty() { None } else { self.spectra.get(first + i) };
            let record = &mut records[keys.len() * n_bytes..][..n_bytes];
            let columns = &cloud.columns;
            let record_source = RecordSource { point: &point, columns, row, stored, source, forward, spectrum };
            delivery.layout.encode(&record_source, record);
            if delivery.withholds.is_some_and(|world| world.is_removed(run, &point)) {
                withhold(record);
            }
            keys.push(key_of(stored));
        }
        records.truncate(keys.len() * n_bytes);
        Ok(Part { records, keys })
    }
}

/// Row numbers of a part, sorted by sweep, LiDAR and laser, otherwise in their original order. Neighbors on a scan line
/// differ little, which halves the size of LAZ: consecutive shots of different lasers differ by metres.
fn scan_line_order(columns: &Columns, rows: &[u8]) -> impl Iterator<Item = usize> {
    let line = |row: &[u8]| {
        let ScanLine { frame, lidar, ring } = columns.scan_line(row);
        u64::from(frame) << 32 | u64::from(lidar) << 24 | u64::from(ring) << 16
    };
    let mut order: Vec<u64> =
        rows.chunks_exact(columns.row_size()).zip(0..).map(|(row, i): (_, u64)| line(row) | i).collect();
    order.sort_unstable();
    order.into_iter().map(|place| (place & 0xffff) as usize)
}

/// Stored coordinates converted to m.
pub(crate) fn metres(stored: [i32; 3], offset_m: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| f64::from(stored[axis]) * SCALE_M + offset_m[axis])
}
