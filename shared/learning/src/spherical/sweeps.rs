//! The sweeps of a submap as images, rebuilt from its columns: laser and encoder angle say where every return was seen.

use super::{PolarImage, PolarPixel};
use crate::Cloud;
use geometry::{RangeImage, column_of_azimuth};
use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapHeader, SubmapPoint, SubmapSweep};
use std::ops::Range;

/// One sweep of a submap.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Its points in the submap.
    pub points: Range<usize>,
    /// Which of them each pixel shows; indexes count from the sweep's first point.
    pub image: RangeImage,
    /// Those points seen from where the sensor was.
    pub polar: PolarImage,
}

/// Where the points of each sweep of a submap lie; sweeps that the header places outside of the points are left out.
pub fn point_ranges(cloud: &Cloud<'_>) -> Vec<(SubmapSweep, Range<usize>)> {
    let n_sweeps = (cloud.header.n_sweeps as usize).min(MAX_SWEEPS_PER_SUBMAP);
    let range = |sweep: &SubmapSweep| {
        let first = sweep.first_point as usize;
        (*sweep, first..first + sweep.n_points as usize)
    };
    cloud.header.sweeps[..n_sweeps].iter().map(range).filter(|(_, range)| range.end <= cloud.points.len()).collect()
}

/// Rows of the images of a submap's sweeps.
pub fn rows_of(header: &SubmapHeader) -> usize {
    (header.n_rings as usize).clamp(1, 256)
}

/// The image of one sweep: row 0 is the highest laser, columns count encoder angles. `heights_m` are those of all points
/// above the ground; where they are no number, the sensor is taken to be 2 m above it.
pub fn sweep(cloud: &Cloud<'_>, sweep: &SubmapSweep, points: Range<usize>, columns: usize, heights_m: &[f32]) -> Sweep {
    let rows = rows_of(cloud.header);
    let of_sweep = &cloud.points[points.clone()];
    let ray = |point: &SubmapPoint| {
        let share = point.offset_nanos as f32 / sweep.duration_nanos.max(1) as f32;
        let (begin, end) = (&sweep.submap_from_lidar_begin, &sweep.submap_from_lidar_end);
        let origin = |i: usize| begin[i] + share.min(1.0) * (end[i] - begin[i]);
        [point.x - origin(0), point.y - origin(1), point.z - origin(2)]
    };
    let placed = of_sweep.iter().map(|point| {
        let [x, y, z] = ray(point);
        let range_m = (x * x + y * y + z * z).sqrt();
        let row = rows.checked_sub(1 + usize::from(point.ring));
        let seen = row.filter(|_| range_m > 0.0);
        (seen.map(|row| (row, column_of_azimuth(point.azimuth, columns))), range_m)
    });
    let image = RangeImage::new(rows, columns, placed);
    let polar = PolarImage::of(&image, of_sweep.iter().any(|point| point.intensity > 0), |index| {
        let (point, height_m) = (&of_sweep[index], heights_m[points.start + index]);
        let ray = ray(point);
        let height_m = if height_m.is_finite() { height_m } else { ray[2] + 2.0 };
        PolarPixel { ray, height_m, intensity: point.intensity }
    });
    Sweep { points, image, polar }
}

/// The images of all sweeps of a submap, in order.
pub fn sweeps(cloud: &Cloud<'_>, columns: usize, heights_m: &[f32]) -> Vec<Sweep> {
    let ranges = point_ranges(cloud).into_iter();
    ranges.map(|(of, points)| sweep(cloud, &of, points, columns, heights_m)).collect()
}
