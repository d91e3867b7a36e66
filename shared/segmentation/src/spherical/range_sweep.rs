//! The range images of the sweeps of a submap. Ring and azimuth of a point determine its pixel; without rings,
//! elevation and azimuth.

use super::camera_columns::CameraColumns;
use super::coarse_azimuths::shown_points;
use super::{CameraBand, PolarImage, PolarPixel};
use crate::ModelInput;
use geometry::{NO_POINT, RangeImage, column_of_azimuth};
use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapHeader, SubmapPoint, SubmapSweep};
use std::borrow::Cow;
use std::ops::Range;

/// Rows of the range image of a sensor without rings: the number of beams of the largest sensor of the training.
const ROWS_WITHOUT_RINGS: usize = 64;

/// One sweep of a submap as a range image.
#[derive(Clone, Debug)]
pub struct RangeSweep {
    /// Indices of the points in the submap.
    pub points: Range<usize>,
    /// The nearest point of each pixel; indices count from the first point of the sweep.
    pub image: RangeImage,
    /// The image of rays relative to the position of the LiDAR. If a sensor's firings are farther apart than the
    /// columns, gaps show the point to their left.
    pub polar: PolarImage,
}

/// A sweep of a submap.
#[derive(Clone, Debug)]
pub struct SweepPoints {
    /// Entry in the header.
    pub sweep: SubmapSweep,
    /// Indices of the points in the submap.
    pub points: Range<usize>,
}

/// The sweeps with their points, ascending. Sweeps whose points are not in the submap, or belong to an earlier sweep,
/// are skipped.
pub fn sweeps_with_points(input: &ModelInput<'_>) -> Vec<SweepPoints> {
    let n_sweeps = (input.header.n_sweeps as usize).min(MAX_SWEEPS_PER_SUBMAP);
    let mut end = 0;
    let range = |sweep: &SubmapSweep| {
        let first = sweep.first_point as usize;
        let range = first..first + sweep.n_points as usize;
        let is_next = range.start >= end && range.end <= input.points.len();
        end = if is_next { range.end } else { end };
        is_next.then_some(SweepPoints { sweep: *sweep, points: range })
    };
    input.header.sweeps[..n_sweeps].iter().filter_map(range).collect()
}

/// Number of rows of the range image of a sweep.
pub fn rows_of(header: &SubmapHeader, sweep: &SubmapSweep) -> usize {
    match n_rings(header, sweep) {
        Some(n_rings) => n_rings.min(256),
        None => ROWS_WITHOUT_RINGS,
    }
}

/// Number of rings of the LiDAR of a sweep. Sensors with non-repetitive patterns have no rings.
fn n_rings(header: &SubmapHeader, sweep: &SubmapSweep) -> Option<usize> {
    Some(header.ring_counts().get(sweep.lidar) as usize).filter(|n_rings| *n_rings > 1)
}

/// Rows of points without rings: equal steps from the highest to the lowest elevation of a sweep.
struct ElevationRows {
    highest: i16,
    steps: usize,
}

impl ElevationRows {
    fn from_points(points: &[SubmapPoint]) -> Self {
        let elevations = || points.iter().map(|point| point.elevation);
        let highest = elevations().max().unwrap_or(0);
        let lowest = elevations().min().unwrap_or(0);
        Self { highest, steps: (i32::from(highest) - i32::from(lowest)) as usize + 1 }
    }

    fn row(&self, elevation: i16) -> usize {
        (i32::from(self.highest) - i32::from(elevation)) as usize * ROWS_WITHOUT_RINGS / self.steps
    }
}

/// Source of the range images of a submap.
pub struct ImageSource<'a> {
    input: &'a ModelInput<'a>,
    columns: usize,
    heights_m: &'a [f32],
    removed: Option<&'a [bool]>,
    camera: CameraColumns<'a>,
}

impl<'a> ImageSource<'a> {
    /// Creates a source of images with this number of columns. `heights_m` are the heights of all points above the
    /// ground; where they are NaN, the LiDAR is assumed to be 2 m above it.
    pub fn new(input: &'a ModelInput<'a>, columns: usize, heights_m: &'a [f32]) -> Self {
        Self { input, columns, heights_m, removed: None, camera: CameraColumns::default() }
    }
    /// Excludes points.
    #[must_use]
    pub fn without(self, removed: Option<&'a [bool]>) -> Self {
        Self { removed, ..self }
    }
    /// Adds camera measurements.
    #[must_use]
    pub fn with_camera(self, bands: &[CameraBand]) -> Self {
        Self { camera: CameraColumns::new(self.input, bands), ..self }
    }
    /// The range images of all sweeps of the submap, in order.
    pub fn sweeps(&self) -> Vec<RangeSweep> {
        sweeps_with_points(self.input).iter().map(|of| self.sweep(of)).collect()
    }
    /// The range image of one sweep.
    pub(super) fn sweep(&self, of: &SweepPoints) -> RangeSweep {
        range_sweep(self, &of.sweep, of.points.clone())
    }
}

/// The range image of one sweep: row 0 is the highest ring or elevation, columns count azimuths.
fn range_sweep(source: &ImageSource<'_>, sweep: &SubmapSweep, points: Range<usize>) -> RangeSweep {
    let ImageSource { input, columns, heights_m, removed, ref camera } = *source;
    let rows = rows_of(input.header, sweep);
    let of_sweep = &input.points[points.clone()];
    let ray = |point: &SubmapPoint| {
        let share = point.offset_nanos as f32 / sweep.duration_nanos.max(1) as f32;
        let begin = &sweep.submap_from_lidar_begin;
        let end = &sweep.submap_from_lidar_end;
        let origin = |i: usize| begin[i] + share.min(1.0) * (end[i] - begin[i]);
        [point.x - origin(0), point.y - origin(1), point.z - origin(2)]
    };
    let elevation_rows = n_rings(input.header, sweep).is_none().then(|| ElevationRows::from_points(of_sweep));
    let placed = of_sweep.iter().enumerate().map(|(index, point)| {
        let [x, y, z] = ray(point);
        let range_m = (x * x + y * y + z * z).sqrt();
        let row = match &elevation_rows {
            Some(by_elevation) => Some(by_elevation.row(point.elevation)),
            None => rows.checked_sub(1 + usize::from(point.ring)),
        };
        let is_removed = removed.is_some_and(|removed| removed[points.start + index]);
        let row = row.filter(|_| range_m > 0.0 && !is_removed);
        (row.map(|row| (row, column_of_azimuth(point.azimuth, columns))), range_m)
    });
    let image = RangeImage::new(rows, columns, placed);
    let shown =
        if elevation_rows.is_some() { Cow::Borrowed(&image.nearest[..]) } else { shown_points(&image, of_sweep) };
    let has_intensity = of_sweep.iter().any(|point| point.intensity > 0);
    let mut polar = PolarImage::showing(&shown, columns, has_intensity, |index| {
        let point = &of_sweep[index];
        let height_m = heights_m[points.start + index];
        let ray = ray(point);
        let height_m = if height_m.is_finite() { height_m } else { ray[2] + 2.0 };
        PolarPixel { ray, height_m, intensity: point.intensity }
    });
    if !camera.is_empty() {
        for &point in shown.iter() {
            match point {
                NO_POINT => camera.push_nothing(&mut polar.camera),
                point => camera.push_point(points.start + point as usize, &mut polar.camera),
            }
        }
    }
    drop(shown);
    RangeSweep { points, image, polar }
}

/// The range images of all sweeps of a submap, in order.
pub fn range_sweeps(input: &ModelInput<'_>, columns: usize, heights_m: &[f32]) -> Vec<RangeSweep> {
    ImageSource::new(input, columns, heights_m).sweeps()
}
