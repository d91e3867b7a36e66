//! Control points, and where the submaps show them.

use crate::drives::Submaps;
use crate::error::SurveyError;
use geometry::{Geodetic, Point3, Pose, Vector3};
use georeference::SurfacePoint;
use std::path::Path;
use surveying::check_points::{CheckPoint, PointUse};

/// Errors of a picked position, and of the surface around a height point, m.
const PICK_M: f64 = 0.02;
const SURFACE_M: f64 = 0.01;
/// Surfaces within this horizontal distance give the height of a height point, m.
const RADIUS_M: f64 = 0.75;
/// Least vertical component of their normals.
const MIN_UPWARDS: f64 = 0.9;
/// The lowest surface there is the ground; others up to this height above it belong to it, m: less than a kerb.
const GROUND_M: f64 = 0.08;
/// Height points are seen from submaps whose middle is within this distance, m.
const SEEN_M: f64 = 30.0;

/// A point with known coordinates in the survey frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlPoint {
    /// Its name, use, deviations, and picked position.
    pub point: CheckPoint,
    /// Its coordinates.
    pub p_in_survey: Point3<f64>,
}

/// A control or check point in one submap.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenControl {
    /// Index of the point.
    pub point: usize,
    /// Number of the submap in the survey.
    pub submap: usize,
    /// Its position in the submap, m. For height points, the surface below or above it.
    pub p_in_submap: Point3<f64>,
    /// Its known coordinates.
    pub p_in_survey: Point3<f64>,
    /// Standard deviation horizontally along each axis, and up, m. `None`: not measured.
    pub sigma_m: [Option<f64>; 2],
    /// Share in the measurements of this point.
    pub share: f64,
}

/// Converts points to the survey frame. `geodetic` gives the position on the Earth of coordinates in the system of the table.
pub fn control_points(
    submaps: &Submaps,
    points: Vec<CheckPoint>,
    table: &Path,
    geodetic: impl Fn([f64; 3]) -> Result<Geodetic, String>,
) -> Result<Vec<ControlPoint>, SurveyError> {
    let known = |name: &str| submaps.drives.iter().any(|drive| drive.name == name);
    let convert = |point: CheckPoint| {
        if let Some(drive) = point.drive.as_deref().filter(|name| !known(name)) {
            let names: Vec<&str> = submaps.drives.iter().map(|drive| drive.name.as_str()).collect();
            let rule = format!("point {:?}: drive {drive:?} must be one of {}", point.name, names.join(", "));
            return Err(SurveyError::content(table, rule));
        }
        if point.in_cloud.is_some() && point.drive.is_none() {
            let rule =
                format!("point {:?} has a picked position without a `drive` in whose cloud it was picked", point.name);
            return Err(SurveyError::content(table, rule));
        }
        let place = geodetic(point.xyz)
            .map_err(|rule| SurveyError::content(table, format!("point {:?}: {rule}", point.name)))?;
        Ok(ControlPoint { p_in_survey: submaps.frame.world_from_geodetic(&place), point })
    };
    points.into_iter().map(convert).collect()
}

/// Finds the points in the submaps for the current poses.
pub fn seen(submaps: &Submaps, poses: &[Pose], points: &[ControlPoint]) -> Vec<SeenControl> {
    let centers = submaps.centers(poses);
    let mut seen = Vec::new();
    for (index, ControlPoint { point, p_in_survey }) in points.iter().enumerate() {
        let first = seen.len();
        let [horizontal, up] = point.deviation_m();
        let found = |submap: usize, p_in_submap: Point3<f64>, sigma_m: [Option<f64>; 2]| SeenControl {
            point: index,
            submap,
            p_in_submap,
            p_in_survey: *p_in_survey,
            sigma_m,
            share: 1.0,
        };
        if let (Some(picked), Some(drive)) = (point.in_cloud, &point.drive) {
            let picked = picked_in(submaps, drive, Point3::from(picked));
            let sigma_m = [horizontal, up].map(|sigma| Some(sigma.hypot(PICK_M)));
            seen.extend(picked.map(|(submap, p)| found(submap, p, sigma_m)));
        } else {
            let near = (0..centers.len()).filter(|k| (centers[*k] - p_in_survey).xy().norm() < SEEN_M);
            let surfaces = near.filter_map(|k| Some((k, ground_at(submaps, k, &poses[k], p_in_survey)?)));
            let sigma_m = [None, Some(up.hypot(SURFACE_M))];
            seen.extend(surfaces.map(|(k, p)| found(k, p, sigma_m)));
        }
        let n = seen.len() - first;
        for seen in &mut seen[first..] {
            seen.share = 1.0 / n as f64;
        }
    }
    seen
}

/// The submap whose surfaces are nearest to a position that was picked in the cloud of a drive, and the position in it.
fn picked_in(submaps: &Submaps, drive: &str, picked: Point3<f64>) -> Option<(usize, Point3<f64>)> {
    let of_drive = (0..submaps.all.len()).filter(|k| submaps.drives[submaps.all[*k].drive].name == drive);
    let nearest = of_drive.filter_map(|k| {
        let submap = &submaps.all[k];
        let survey_from_run = &submaps.drives[submap.drive].survey_from_run;
        let p = submap.survey_from_submap.inverse() * (survey_from_run * picked);
        let distances = submap.keyframe.surfaces().map(|surface| (surface.position - p).norm());
        distances.reduce(f64::min).map(|distance| (k, p, distance))
    });
    nearest.min_by(|a, b| a.2.total_cmp(&b.2)).map(|(k, p, _)| (k, p))
}

/// The ground of a submap at the horizontal position of a point, in the submap.
fn ground_at(submaps: &Submaps, k: usize, pose: &Pose, p_in_survey: &Point3<f64>) -> Option<Point3<f64>> {
    let p = pose.inverse() * p_in_survey;
    let up = pose.rotation.inverse() * Vector3::z();
    let off = |surface: &SurfacePoint| surface.position - p;
    let is_near = |surface: &SurfacePoint| {
        let off = off(surface);
        (off - up * off.dot(&up)).norm() < RADIUS_M && surface.normal.dot(&up).abs() > MIN_UPWARDS
    };
    let near: Vec<SurfacePoint> = submaps.all[k].keyframe.surfaces().filter(is_near).collect();
    // Height of the plane of each surface above the point.
    let heights: Vec<f64> =
        near.iter().map(|surface| surface.normal.dot(&off(surface)) / surface.normal.dot(&up)).collect();
    let lowest = heights.iter().copied().reduce(f64::min)?;
    let ground: Vec<f64> = heights.into_iter().filter(|height| *height < lowest + GROUND_M).collect();
    Some(p + up * (ground.iter().sum::<f64>() / ground.len() as f64))
}

impl SeenControl {
    /// Position in the submap minus known coordinates, east, north and up, m. Axes that were not measured are `None`.
    pub fn residual_m(&self, poses: &[Pose]) -> [Option<f64>; 3] {
        let off = poses[self.submap] * self.p_in_submap - self.p_in_survey;
        let [horizontal, up] = self.sigma_m.map(|sigma| sigma.is_some());
        [horizontal.then_some(off.x), horizontal.then_some(off.y), up.then_some(off.z)]
    }
}

impl ControlPoint {
    /// Whether the point moves the result.
    pub fn is_control(&self) -> bool {
        self.point.point_use == PointUse::Control
    }
}
