//! Sweeps: rows of x y z intensity, laser and time as f32. The time is relative to the stamp in the file name, s; the
//! stamp is the middle of the revolution.

use crate::error::{At, ImportError};
use files::regular_file;
use formats::cloud::{CloudPoint, FiredCloud, FiredPoint, check_points};
use formats::cloud_fields::{Elevations, Rings};
use formats::pcd::pcd_from_cloud;
use lidar::SweepReader;
use std::path::{Path, PathBuf};

const ROW_BYTES: usize = 24;
/// Largest intensity.
const MAX_INTENSITY: f32 = 255.0;
/// Largest number of a laser.
const MAX_LASER: f32 = 255.0;
/// Times are within half a revolution; a slow one takes 0.2 s.
const MAX_TIME_S: f32 = 0.25;

/// The points of a file.
pub(super) struct SweepFile {
    path: PathBuf,
    /// Time of the first point, ns.
    pub begin: i64,
    points: Vec<CloudPoint>,
    lasers: Vec<u16>,
    /// Times of the points, ns.
    times: Vec<i64>,
}

impl SweepFile {
    pub fn read(path: &Path, stamp: i64) -> Result<Self, ImportError> {
        let bytes = regular_file::read(path).at(path)?;
        let (rows, rest) = bytes.as_chunks::<ROW_BYTES>();
        if rows.is_empty() || !rest.is_empty() {
            let rule = format!("{} bytes must be rows of {ROW_BYTES} bytes: x y z intensity laser time", bytes.len());
            return Err(ImportError::at(path, rule));
        }
        let limit = SweepReader::MAX_RETURNS;
        if rows.len() > limit {
            return Err(ImportError::at(path, format!("{} points; a sweep has at most {limit}", rows.len())));
        }
        let mut sweep =
            Self { path: path.to_owned(), begin: i64::MAX, points: Vec::new(), lasers: Vec::new(), times: Vec::new() };
        for (index, row) in rows.iter().enumerate() {
            let value = |at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
            let [x, y, z, intensity, laser, time_s] = [0, 4, 8, 12, 16, 20].map(value);
            let fault = |name: &str, value: f32, rule: String| {
                ImportError::at(path, format!("point {index}: {name} is {value}; it must be {rule}"))
            };
            if !(0.0..=MAX_LASER).contains(&laser) || laser.fract() != 0.0 {
                return Err(fault("the laser", laser, format!("a number from 0 to {MAX_LASER}")));
            }
            if time_s.is_nan() || time_s.abs() > MAX_TIME_S {
                return Err(fault("the time", time_s, format!("{MAX_TIME_S} s or less from the stamp in the name")));
            }
            let time = stamp.saturating_add((f64::from(time_s) * 1e9).round() as i64);
            sweep.begin = sweep.begin.min(time);
            sweep.points.push(CloudPoint { x, y, z, intensity });
            sweep.lasers.push(laser as u16);
            sweep.times.push(time);
        }
        check_points(&sweep.points, MAX_INTENSITY).at(path)?;
        Ok(sweep)
    }

    /// Adds the points to the elevations of the lasers.
    pub fn add_to(&self, elevations: &mut Elevations) {
        for (p, laser) in self.points.iter().zip(&self.lasers) {
            elevations.add(*laser, [p.x, p.y, p.z]);
        }
    }

    /// The file of the drive.
    pub fn pcd(&self, rings: Option<&Rings>) -> Result<Vec<u8>, ImportError> {
        let mut points = Vec::with_capacity(self.points.len());
        for ((point, laser), time) in self.points.iter().zip(&self.lasers).zip(&self.times) {
            let ring = match rings {
                Some(rings) => rings.get(*laser).ok_or_else(|| {
                    let rule = format!("a point is of laser {laser}; the LiDAR has {}", rings.n_rings());
                    ImportError::at(&self.path, rule)
                })?,
                None => 0,
            };
            points.push(FiredPoint { point: *point, ring, offset_nanos: (time - self.begin) as u32 });
        }
        Ok(pcd_from_cloud(&FiredCloud { points, has_rings: rings.is_some(), has_times: true }))
    }
}
