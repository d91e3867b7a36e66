//! Sweeps that are PLY or LAS files, with their rings and times, if present.

use crate::error::{At, ImportError};
use crate::las::{LasPoint, each_block};
use crate::point_times::TimeForm;
use crate::rings::{Elevations, Rings};
use formats::cloud::{CloudPoint, FiredPoint};
use formats::pcd::{PcdCloud, pcd_from_cloud};
use formats::ply::Vertices;
use lidar::{Lidar, Model};
use std::path::Path;

/// Larger coordinates are map coordinates, m: no LiDAR has such a range.
const MAX_COORDINATE_M: f32 = 10_000.0;
/// Names of columns of a PLY file.
const INTENSITIES: [&str; 5] = ["intensity", "scalar_intensity", "scalar_Intensity", "reflectance", "reflectivity"];
const TIMES: [&str; 9] =
    ["t", "time", "timestamp", "GPS_time", "gps_time", "scalar_time", "scalar_t", "scalar_timestamp", "scalar_GpsTime"];
const RINGS: [&str; 6] = ["ring", "laser", "laser_id", "channel", "scalar_ring", "scalar_laser"];
/// Name of the times of LAS.
const GPS_TIME: &str = "GPS time";
/// Maximum duration of a sweep relative to the time to the next stamp; the drive has the same rule.
const MAX_OVERLAP: f64 = 1.1;
/// Number of sweeps from which the form of times and rings is determined.
const EXAMINED: usize = 8;

/// The points of a file.
pub(super) struct CloudSweep {
    points: Vec<CloudPoint>,
    times: Option<Column<f64>>,
    rings: Option<Column<u16>>,
}

/// A column of a file.
struct Column<T> {
    name: &'static str,
    values: Vec<T>,
}

/// Rules for reading the times and rings of all files.
#[derive(Clone)]
pub(super) struct SweepForm {
    times: Option<(&'static str, Option<TimeForm>)>,
    rings: Option<(&'static str, Option<Rings>)>,
}

impl CloudSweep {
    /// Reads a PLY file.
    pub fn read_ply(path: &Path) -> Result<Self, ImportError> {
        let file = std::fs::read(path).at(path)?;
        // The errors of the reader name the file.
        let cloud = Vertices::decode(file, Path::new("PLY")).at(path)?;
        let [xs, ys, zs] = ["x", "y", "z"].map(|name| cloud.f32s(name));
        let xs = xs.at(path)?;
        let ys = ys.at(path)?;
        let zs = zs.at(path)?;
        let first = |names: &[&'static str]| names.iter().copied().find(|name| cloud.has(name));
        let intensities = first(&INTENSITIES).map(|name| cloud.f32s(name)).transpose().at(path)?;
        let intensities = intensities.unwrap_or_else(|| vec![0.0; xs.len()]);
        let rows = xs.into_iter().zip(ys).zip(zs).zip(intensities);
        let points = rows.map(|(((x, y), z), intensity)| CloudPoint { x, y, z, intensity }).collect();
        let times = match first(&TIMES) {
            Some(name) => Some(Column { name, values: cloud.f64s(name).at(path)? }),
            None => None,
        };
        let rings = match first(&RINGS) {
            Some(name) => {
                let values = cloud.f64s(name).at(path)?.into_iter();
                // A value that is not a beam number becomes a number that no sensor has.
                let beam = |value: f64| {
                    if value.fract() == 0.0 && (0.0..65_535.0).contains(&value) { value as u16 } else { u16::MAX }
                };
                Some(Column { name, values: values.map(beam).collect() })
            }
            None => None,
        };
        Ok(Self { points, times, rings })
    }

    /// Reads a LAS or LAZ file.
    pub fn read_las(path: &Path) -> Result<Self, ImportError> {
        let mut points = Vec::new();
        let mut times = Vec::new();
        each_block(path, |block| {
            for LasPoint { point, time_s } in block {
                points.push(*point);
                times.extend(time_s);
            }
            Ok(())
        })?;
        if let Some(far) = points.iter().find(|p| [p.x, p.y, p.z].iter().any(|value| value.abs() > MAX_COORDINATE_M)) {
            let x = far.x;
            let y = far.y;
            let z = far.z;
            let rule = format!("a point is at {x} {y} {z} m; sweeps must be in the frame of the LiDAR");
            return Err(ImportError::at(path, rule));
        }
        let times = (times.len() == points.len()).then_some(Column { name: GPS_TIME, values: times });
        Ok(Self { points, times, rings: None })
    }
}

impl SweepForm {
    /// Determines the form from the first files. `interval_s`: shortest time from one stamp to the next; a longer span
    /// does not belong to one sweep.
    pub fn from_files(
        files: &[&Path],
        interval_s: Option<f64>,
        model: Model,
        read: fn(&Path) -> Result<CloudSweep, ImportError>,
    ) -> Result<Self, ImportError> {
        let mut times = None;
        let mut rings = None;
        let mut elevations = Elevations::default();
        let mut is_long = false;
        for path in files.iter().take(EXAMINED) {
            let sweep = read(path)?;
            if let Some(Column { name, values }) = &sweep.times {
                let range = values.iter().copied().reduce(f64::min).zip(values.iter().copied().reduce(f64::max));
                // Separate clock: the first point of a file is at the stamp of the sweep.
                let form = range.and_then(|(min, max)| TimeForm::from_range(min, max, i64::MAX));
                // The times of LAS are in s.
                let form = form.filter(|form| *name != GPS_TIME || form.unit() == "s");
                let span_s = range.zip(form).map(|((min, max), form)| form.seconds(max - min));
                is_long |= span_s.zip(interval_s).is_some_and(|(span_s, interval_s)| span_s > MAX_OVERLAP * interval_s);
                let known = times.get_or_insert((*name, form));
                known.1 = known.1.or(form).filter(|_| !is_long);
            }
            if let Some(Column { name, values }) = &sweep.rings {
                rings = Some(*name);
                sweep.points.iter().zip(values).for_each(|(p, ring)| elevations.add(*ring, [p.x, p.y, p.z]));
            }
        }
        let n_rings = u16::try_from(Lidar::from(model).n_rings()).ok().filter(|n| *n > 0);
        Ok(Self { times, rings: rings.map(|name| (name, elevations.rings(n_rings, 1))) })
    }

    /// Lines of the report.
    pub fn report(&self) -> Vec<String> {
        let times = match &self.times {
            Some((name, Some(form))) => {
                format!("point times: {name}, in {}, from the first point of each file", form.unit())
            }
            Some((name, None)) => format!(
                "no point times: {name} does not span 5 ms to the next stamp, at most 0.5 s, in s, ms, us or ns"
            ),
            None => "no point times: the files contain no times".to_owned(),
        };
        let rings = match &self.rings {
            Some((name, Some(rings))) => format!("rings: {name}, {} beams counted {}", rings.n_rings(), rings.order),
            Some((name, None)) => {
                format!("no rings: {name} does not number the beams of the LiDAR, each of one elevation")
            }
            None => "no rings: the files contain no rings".to_owned(),
        };
        vec![times, rings]
    }

    /// The file of a sweep in the drive.
    pub fn pcd(&self, sweep: &CloudSweep) -> Result<Vec<u8>, String> {
        let n = sweep.points.len();
        let form = self.times.as_ref().and_then(|(_, form)| *form);
        let offsets = match (form, &sweep.times) {
            (Some(form), Some(column)) => offsets(form, &column.values)?,
            (Some(_), None) => return Err("has no point times; the previous files have".to_owned()),
            (None, _) => vec![0; n],
        };
        let rings = self.rings.as_ref().and_then(|(_, rings)| rings.as_ref());
        let ring = |index: usize| -> Result<u8, String> {
            let Some(rings) = rings else { return Ok(0) };
            let beam = sweep.rings.as_ref().map_or(u16::MAX, |column| column.values[index]);
            rings.get(beam).ok_or_else(|| format!("point {index} is of beam {beam}; the LiDAR has {}", rings.n_rings()))
        };
        let mut points = Vec::with_capacity(n);
        for (index, (point, offset_nanos)) in sweep.points.iter().zip(offsets).enumerate() {
            points.push(FiredPoint { point: *point, ring: ring(index)?, offset_nanos });
        }
        Ok(pcd_from_cloud(&PcdCloud { points, has_rings: rings.is_some(), has_times: form.is_some() }))
    }
}

/// Times after the first point, ns.
fn offsets(form: TimeForm, times: &[f64]) -> Result<Vec<u32>, String> {
    // Separate clock: the earliest time is at the stamp, here 0.
    let nanos = form.nanos(times.iter().copied(), 0).ok_or("a time is not a number in the range of times")?;
    let first = nanos.iter().copied().min().unwrap_or(0);
    let offset = |nanos: i64| {
        let after = nanos.checked_sub(first).and_then(|after| u32::try_from(after).ok());
        after.ok_or_else(|| "the times of the points span more than 4 s".to_owned())
    };
    nanos.into_iter().map(offset).collect()
}
