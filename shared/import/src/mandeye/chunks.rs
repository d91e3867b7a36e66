//! Sweeps cut from chunks of points.

use crate::error::ImportError;
use crate::las::each_block;
use formats::cloud::{CloudPoint, FiredCloud, FiredPoint};
use formats::cloud_fields::PointFlags;
use formats::pcd::pcd_from_cloud;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};

/// Duration of a sweep, ns.
const SWEEP_NANOS: i64 = 100_000_000;
/// Larger times are damage, s: the year 2255.
const MAX_TIME_S: f64 = 9e9;

/// The chunks, and the sweeps in them.
pub(super) struct Chunks {
    files: Vec<PathBuf>,
    sweeps: Vec<Sweep>,
    /// Flagged points of all chunks.
    flags: PointFlags,
    /// Points of the chunks from which the last sweep was cut, by the index of their file: a sweep may begin in one chunk
    /// and end in the next.
    loaded: RefCell<BTreeMap<usize, Vec<(i64, CloudPoint)>>>,
}

/// The points of a tenth of a second.
pub(super) struct Sweep {
    /// Time of the first point, ns.
    pub stamp: i64,
    pub n_points: usize,
    /// Number of the tenth of a second.
    tenth: i64,
    /// Indexes of the first and of the last file with points of it.
    files: (usize, usize),
}

impl Chunks {
    /// Reads the times of all points.
    pub fn scan(files: Vec<PathBuf>) -> Result<Self, ImportError> {
        let mut sweeps: BTreeMap<i64, Sweep> = BTreeMap::new();
        let mut flags = PointFlags::default();
        for (index, path) in files.iter().enumerate() {
            let of_file = each_point(path, |nanos, _| {
                let tenth = nanos.div_euclid(SWEEP_NANOS);
                let new = || Sweep { stamp: nanos, n_points: 0, tenth, files: (index, index) };
                let sweep = sweeps.entry(tenth).or_insert_with(new);
                sweep.stamp = sweep.stamp.min(nanos);
                sweep.n_points += 1;
                sweep.files.1 = index;
            })?;
            flags = flags.plus(of_file);
        }
        Ok(Self { files, sweeps: sweeps.into_values().collect(), flags, loaded: RefCell::new(BTreeMap::new()) })
    }

    pub fn flags(&self) -> PointFlags {
        self.flags
    }

    pub fn sweeps(&self) -> &[Sweep] {
        &self.sweeps
    }

    /// The file of a sweep. Sweeps requested in order need the points of one chunk at a time, or of two at a border.
    pub fn sweep(&self, seq: usize) -> Result<Vec<u8>, ImportError> {
        let sweep = &self.sweeps[seq];
        let (first, last) = sweep.files;
        let mut loaded = self.loaded.borrow_mut();
        loaded.retain(|index, _| (first..=last).contains(index));
        let from = sweep.tenth * SWEEP_NANOS;
        let to = (sweep.tenth + 1) * SWEEP_NANOS;
        let mut points = Vec::with_capacity(sweep.n_points);
        for index in first..=last {
            let chunk = match loaded.entry(index) {
                Entry::Occupied(chunk) => chunk.into_mut(),
                Entry::Vacant(place) => place.insert(sorted(&self.files[index])?),
            };
            let begin = chunk.partition_point(|(nanos, _)| *nanos < from);
            points.extend(chunk[begin..].iter().take_while(|(nanos, _)| *nanos < to));
        }
        points.sort_by_key(|(nanos, _)| *nanos);
        let fired = |(nanos, point)| FiredPoint { point, ring: 0, offset_nanos: (nanos - sweep.stamp) as u32 };
        let points = points.into_iter().map(fired).collect();
        Ok(pcd_from_cloud(&FiredCloud { points, has_rings: false, has_times: true }))
    }
}

/// All points of a chunk by time.
fn sorted(path: &Path) -> Result<Vec<(i64, CloudPoint)>, ImportError> {
    let mut points = Vec::new();
    each_point(path, |nanos, point| points.push((nanos, *point)))?;
    points.sort_by_key(|(nanos, _)| *nanos);
    Ok(points)
}

/// Passes time, ns, and point to `take`.
fn each_point(path: &Path, mut take: impl FnMut(i64, &CloudPoint)) -> Result<PointFlags, ImportError> {
    let mut index = 0_u64;
    each_block(path, |block| {
        for las_point in block {
            // Points without times are refused as well.
            let time_s = las_point.time_s.unwrap_or(f64::NAN);
            if !(0.0..MAX_TIME_S).contains(&time_s) {
                let rule = format!("point {index} has the time {time_s} s; it must be 0 to {MAX_TIME_S}");
                return Err(ImportError::at(path, rule));
            }
            take((time_s * 1e9).round() as i64, &las_point.point());
            index += 1;
        }
        Ok(())
    })
}
