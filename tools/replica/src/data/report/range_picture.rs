//! A sweep as a range image.

use super::moment::MomentPoint;
use image::{Rgb, RgbImage};
use pictures::cloud_picture::{ramp, share};
use std::collections::BTreeMap;

/// Columns of the image, px: half a degree each. Sensors that turn fast have few more columns.
const WIDTH: usize = 720;
/// Approximate height of the image, px.
const HEIGHT: usize = 192;
/// Ranges of the first and the last color, m.
pub const RANGE_M: [f64; 2] = [2.0, 80.0];

/// The sweep with most points: a row for each ring, the highest on top, a column for each azimuth. `None` without points.
pub fn range_picture(points: &[MomentPoint]) -> Option<RgbImage> {
    let mut sweeps: BTreeMap<i64, usize> = BTreeMap::new();
    for point in points {
        *sweeps.entry(point.sweep).or_default() += 1;
    }
    let (sweep, _) = sweeps.into_iter().max_by_key(|(sweep, n)| (*n, -sweep))?;
    let of_sweep = || points.iter().filter(|point| point.sweep == sweep);
    // On some sensors ring numbers are not ordered by elevation.
    let mut elevations: BTreeMap<u8, (f64, usize)> = BTreeMap::new();
    for point in of_sweep() {
        let (sum, n) = elevations.entry(point.ring).or_default();
        *sum += f64::from(point.elevation_deg);
        *n += 1;
    }
    let mut rings: Vec<(f64, u8)> = elevations.iter().map(|(ring, (sum, n))| (sum / *n as f64, *ring)).collect();
    rings.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let row_of: BTreeMap<u8, usize> = rings.iter().enumerate().map(|(row, (_, ring))| (*ring, row)).collect();
    let n_rows = row_of.len();
    let mut nearest = vec![f64::INFINITY; n_rows * WIDTH];
    for point in of_sweep() {
        let range_m = (point.position - point.lidar).norm();
        let column = (f64::from(point.azimuth_deg).rem_euclid(360.0) / 360.0 * WIDTH as f64) as usize;
        let pixel = row_of[&point.ring] * WIDTH + column.min(WIDTH - 1);
        // NaN is not smaller than any number.
        if range_m < nearest[pixel] {
            nearest[pixel] = range_m;
        }
    }
    let px_per_row = (HEIGHT / n_rows).max(1);
    let color = |range_m: f64| {
        if range_m.is_finite() {
            Rgb(ramp(1.0 - share(range_m.max(1e-3).ln(), RANGE_M.map(f64::ln))))
        } else {
            Rgb([0; 3])
        }
    };
    Some(RgbImage::from_fn(WIDTH as u32, (n_rows * px_per_row) as u32, |u, v| {
        color(nearest[v as usize / px_per_row * WIDTH + u as usize])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;

    #[test]
    fn rows_of_the_range_image_are_by_elevation_and_near_points_win() {
        let point = |ring: u8, elevation_deg: f32, azimuth_deg: f32, range_m: f64| MomentPoint {
            position: Point3::new(range_m, 0.0, 0.0),
            lidar: Point3::origin(),
            sweep: 4,
            ring,
            azimuth_deg,
            elevation_deg,
        };
        let other = MomentPoint { sweep: 5, ..point(3, 80.0, 0.0, 1.0) };
        let points = [point(0, 10.0, 90.0, 80.0), point(1, -10.0, 180.0, 80.0), point(1, -10.0, 180.0, 2.0), other];
        let image = range_picture(&points).expect("has points");
        assert_eq!(image.dimensions(), (WIDTH as u32, HEIGHT as u32), "two rings of one sweep");
        assert_eq!(image.get_pixel(180, 10), &Rgb([68, 1, 84]), "far, above");
        assert_eq!(image.get_pixel(360, 150), &Rgb([253, 231, 37]), "near, below");
        assert_eq!(image.get_pixel(360, 10), &Rgb([0; 3]));
        assert!(range_picture(&[]).is_none());
    }
}
