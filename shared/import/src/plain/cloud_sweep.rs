//! Sweeps that are PCD, PLY or LAS files.

use crate::error::{At, ImportError};
use crate::las::{GPS_TIME, raw_from_las};
use files::regular_file;
use formats::cloud::MAX_RANGE_M;
use formats::cloud_fields::{CloudForm, FormBuilder, RawCloud, sampled};
use formats::pcd::{pcd_from_cloud, raw_from_pcd};
use formats::ply::Vertices;
use lidar::{Lidar, Model, SweepReader};
use std::path::Path;

/// Longest time of the middle 90 % of the points of a file, s: a sweep takes at most half a second.
const MAX_SPAN_S: f64 = 2.0;

/// Reads the points of a file.
pub(super) type Read = fn(&Path) -> Result<RawCloud, ImportError>;

/// Reads a PCD file.
pub(super) fn read_pcd(path: &Path) -> Result<RawCloud, ImportError> {
    raw_from_pcd(&regular_file::read(path).at(path)?).at(path)
}

/// Reads a PLY file.
pub(super) fn read_ply(path: &Path) -> Result<RawCloud, ImportError> {
    let file = regular_file::read(path).at(path)?;
    // The errors of the reader name the file.
    Vertices::decode(file, Path::new("PLY")).and_then(|vertices| vertices.raw_cloud()).at(path)
}

/// Reads a LAS or LAZ file.
pub(super) fn read_las(path: &Path) -> Result<RawCloud, ImportError> {
    let cloud = raw_from_las(path)?;
    if let Some(times) = &cloud.times {
        let mut values: Vec<f64> = times.values.iter().copied().filter(|time| time.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let span_s = if n < 2 { 0.0 } else { values[n - 1 - n / 20] - values[n / 20] };
        if span_s > MAX_SPAN_S {
            let rule = format!(
                "90 % of its points were measured over {span_s:.1} s: a map, registered by another program, and not one sweep; give \
                 one file for each revolution, in the frame of the LiDAR"
            );
            return Err(ImportError::at(path, rule));
        }
    }
    Ok(cloud)
}

/// The form of the files, from a few of them. `stamps`: stamps of all files, if recorded. `interval_s`: shortest time from one
/// stamp to the next.
pub(super) fn form_of(
    files: &[&Path],
    stamps: Option<&[i64]>,
    interval_s: Option<f64>,
    model: Model,
    read: Read,
) -> Result<CloudForm, ImportError> {
    let n_beams = u16::try_from(Lidar::from(model).n_rings()).ok().filter(|n| *n > 0);
    let mut builder = FormBuilder::new(interval_s, n_beams);
    let indexes: Vec<usize> = (0..files.len()).collect();
    let mut examined = Vec::new();
    for index in sampled(&indexes) {
        let path = files[*index];
        let cloud = read(path)?;
        if cloud.times.as_ref().is_some_and(|times| times.name == GPS_TIME) {
            // The times of LAS are in s.
            builder = builder.with_unit("s");
        }
        builder.add(&cloud, stamps.map(|stamps| stamps[*index])).at(path)?;
        examined.push((path, cloud));
    }
    let form = builder.finish();
    for (path, cloud) in &examined {
        check(&form, cloud).map_err(|rule| ImportError::at(path, rule))?;
    }
    Ok(form)
}

/// Checks that a cloud has the size of a sweep.
fn check(form: &CloudForm, cloud: &RawCloud) -> Result<(), String> {
    let n = cloud.positions.len();
    let limit = SweepReader::MAX_RETURNS;
    if n > limit && (0..n).filter(|index| cloud.is_return(*index)).count() > limit {
        return Err(format!("{n} points; a sweep has at most {limit}: a map, and not one sweep"));
    }
    let origin = if cloud.has_map_coordinates() { form.origin } else { None };
    cloud.check_extent(origin, f64::from(MAX_RANGE_M)).map_err(|fault| fault.to_string())
}

/// The file of a sweep in the drive.
pub(super) fn pcd(form: &CloudForm, cloud: &RawCloud, stamp: i64) -> Result<Vec<u8>, String> {
    cloud.map_origin().map_err(|fault| fault.to_string())?;
    check(form, cloud)?;
    form.fired(cloud, stamp).map(|fired| pcd_from_cloud(&fired)).map_err(|fault| fault.to_string())
}
