//! The path, and the distances of the receiver's fixes from it.

use super::finished_run::FinishedRun;
use chart::{COLORS, Chart, Series};
use drive::Drive;
use geometry::{Geodetic, LocalFrame, Point3, Vector3};
use lidar::nmea::Fix;
use serde::Serialize;

/// Largest number of vertices of the path in the map.
const MAX_VERTICES: usize = 2000;
/// Largest number of fixes in the map.
const MAX_FIXES: usize = 2000;

/// Path and fixes.
#[derive(Debug, Serialize)]
pub struct Place {
    /// Length of the trajectory, m.
    pub length_m: f64,
    /// Time from the first pose to the last, s.
    pub seconds: f64,
    /// Deviations of the antenna on the path from the fixes within the time of the trajectory. `None` without fixes or origin.
    pub fixes: Option<FixDeviations>,
    #[serde(skip)]
    offsets: Vec<FixOffset>,
    #[serde(skip)]
    path: Vec<[f64; 2]>,
    #[serde(skip)]
    has_north: bool,
}

/// Differences of path minus fixes: east, north, up, m.
#[derive(Debug, Serialize)]
pub struct FixDeviations {
    pub n: usize,
    pub rms_east_m: f64,
    pub rms_north_m: f64,
    /// `None` if no fix has a height.
    pub rms_up_m: Option<f64>,
    pub median_horizontal_m: f64,
    pub largest_horizontal_m: f64,
}

impl Place {
    /// `None` without a trajectory.
    pub fn from_run(run: &FinishedRun, drive: Option<&Drive>, fixes: &[Fix]) -> Option<Self> {
        let poses = run.trajectory.poses();
        let first = poses.first()?;
        let last = poses.last()?;
        let step = poses.len().div_ceil(MAX_VERTICES);
        let vertices = poses.iter().step_by(step).chain([last]);
        let path = vertices.map(|(_, pose)| [pose.translation.x, pose.translation.y]).collect();
        let origin = run.georeference.as_ref().and_then(|found| found.origin);
        let offsets = origin.map(|origin| offsets(run, origin, drive, fixes)).unwrap_or_default();
        Some(Self {
            length_m: run.trajectory.length_m(),
            seconds: last.0.seconds_since(first.0),
            fixes: FixDeviations::from_offsets(&offsets),
            offsets,
            path,
            has_north: origin.is_some(),
        })
    }

    /// Path minus fixes, east and north, m.
    pub fn differences(&self) -> Vec<[f64; 2]> {
        let difference = |offset: &FixOffset| (offset.on_path - offset.fix).xy().into();
        self.offsets.iter().map(difference).collect()
    }

    /// Path minus fixes with a height, up, m.
    pub fn height_differences(&self) -> Vec<f64> {
        let with_height = self.offsets.iter().filter(|offset| offset.has_height);
        with_height.map(|offset| offset.on_path.z - offset.fix.z).collect()
    }

    /// The map of the path: east is right and north is up.
    pub fn map(&self) -> String {
        let step = self.offsets.len().div_ceil(MAX_FIXES).max(1);
        let shown = || self.offsets.iter().step_by(step);
        let flat = |p: &Point3<f64>| [p.x, p.y];
        // The fixes first, so that the path is drawn over them.
        let mut series: Vec<Series> =
            shown().map(|o| Series::thin_line("", COLORS[4], vec![flat(&o.on_path), flat(&o.fix)])).collect();
        if !self.offsets.is_empty() {
            series.push(Series::dots("fixes", COLORS[1], shown().map(|offset| flat(&offset.fix)).collect()));
        }
        series.push(Series::line("path", COLORS[0], self.path.clone()));
        let axes = if self.has_north { ["east, m", "north, m"] } else { ["x, m", "y, m"] };
        Chart::map("", axes, series).svg()
    }
}

/// A fix and the path at its time.
#[derive(Clone, Copy, Debug)]
struct FixOffset {
    /// The antenna on the path.
    on_path: Point3<f64>,
    fix: Point3<f64>,
    /// Whether the fix has a height.
    has_height: bool,
}

fn offsets(run: &FinishedRun, origin: Geodetic, drive: Option<&Drive>, fixes: &[Fix]) -> Vec<FixOffset> {
    let frame = LocalFrame::new(origin);
    let gnss = drive.and_then(|drive| drive.manifest().gnss.as_ref());
    let antenna = gnss.map_or(Point3::origin(), |gnss| Point3::from(gnss.antenna_in_body));
    let offset = |fix: &Fix| {
        let on_path = run.trajectory.at(fix.stamp)? * antenna;
        let [latitude_deg, longitude_deg] = fix.position_deg;
        let altitude_m = fix.altitude_m.unwrap_or(origin.altitude_m + on_path.z);
        let place = frame.world_from_geodetic(&Geodetic::new(latitude_deg, longitude_deg, altitude_m)?);
        Some(FixOffset { on_path, fix: place, has_height: fix.altitude_m.is_some() })
    };
    fixes.iter().filter_map(offset).collect()
}

impl FixDeviations {
    fn from_offsets(offsets: &[FixOffset]) -> Option<Self> {
        let differences: Vec<Vector3<f64>> = offsets.iter().map(|offset| offset.on_path - offset.fix).collect();
        let rms = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        let axis = |k: usize| rms(&differences.iter().map(|d| d[k]).collect::<Vec<_>>());
        let with_height = differences.iter().zip(offsets).filter(|(_, offset)| offset.has_height);
        let heights: Vec<f64> = with_height.map(|(d, _)| d.z).collect();
        let mut horizontal: Vec<f64> = differences.iter().map(|d| d.xy().norm()).collect();
        horizontal.sort_by(f64::total_cmp);
        Some(Self {
            n: differences.len(),
            rms_east_m: axis(0),
            rms_north_m: axis(1),
            rms_up_m: (!heights.is_empty()).then(|| rms(&heights)),
            median_horizontal_m: *horizontal.get(horizontal.len() / 2)?,
            largest_horizontal_m: *horizontal.last()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_of_fixes_are_by_axis_and_heights_only_where_known() {
        let offset = |on_path: [f64; 3], fix: [f64; 3], has_height| FixOffset {
            on_path: on_path.into(),
            fix: fix.into(),
            has_height,
        };
        let offsets = [
            offset([3.0, 0.0, 2.0], [0.0, 0.0, 0.0], true),
            offset([0.0, 4.0, 9.0], [0.0, 0.0, 0.0], false),
            offset([1.0, 0.0, 0.0], [1.0, 0.0, 0.0], true),
        ];
        let found = FixDeviations::from_offsets(&offsets).expect("has fixes");
        assert_eq!((found.n, found.median_horizontal_m, found.largest_horizontal_m), (3, 3.0, 4.0));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(found.rms_east_m, 3.0_f64.sqrt());
        near(found.rms_north_m, (16.0_f64 / 3.0).sqrt());
        near(found.rms_up_m.expect("two have a height"), 2.0_f64.sqrt());
        assert!(FixDeviations::from_offsets(&[]).is_none());
    }
}
