//! Points of clouds as returns of a LiDAR.

use crate::rings::cloud_rings;
use formats::cloud::{CloudPoint, FiredPoint};
use lidar::{Lidar, SweepPoint};

/// Shortest range of a return: some files store missing returns as 0 0 0.
const MIN_RANGE_M: f32 = 0.1;

/// Returns in the order of the file, without times. Points that are not finite or closer than 0.1 m are removed. The azimuth is the
/// direction of the point. The rings follow from the order of the points or from the nearest beams; 0 for sensors without fixed
/// beams. Intensities from 0 to 1 are scaled to 0 to 255.
pub fn returns_from_cloud(points: &[CloudPoint], lidar: &Lidar) -> Vec<SweepPoint> {
    let is_fraction = points.iter().all(|point| point.intensity <= 1.0);
    let scale = if is_fraction { 255.0 } else { 1.0 };
    let fired = |p: &CloudPoint| FiredPoint { point: *p, ..FiredPoint::default() };
    returns(points, scale, fired, &cloud_rings(points, |p| *p, lidar))
}

/// Whether a point of a cloud file is a return; others are left out of the sweep, and have no label in a drive.
pub fn is_return(p: &CloudPoint) -> bool {
    let range_m = (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
    range_m.is_finite() && range_m > MIN_RANGE_M
}

/// Returns as from [`returns_from_cloud`]. `scale`: factor of the intensities. `fired` gives the point of a row with its time,
/// `rings` are the rings of the rows.
pub(super) fn returns<T>(rows: &[T], scale: f32, fired: impl Fn(&T) -> FiredPoint, rings: &[u8]) -> Vec<SweepPoint> {
    let one = |(row, ring): (&T, &u8)| {
        let FiredPoint { point: p, offset_nanos, .. } = fired(row);
        SweepPoint {
            x: p.x,
            y: p.y,
            z: p.z,
            offset_nanos,
            // Clockwise in 0.01 deg.
            azimuth: ((-p.y.atan2(p.x).to_degrees() * 100.0).round() as i32).rem_euclid(36_000) as u16,
            intensity: (p.intensity * scale).round().clamp(0.0, 255.0) as u8,
            ring: *ring,
        }
    };
    rows.iter().zip(rings).filter(|(row, _)| is_return(&fired(row).point)).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lidar::velodyne::Model;

    #[test]
    fn ring_and_azimuth_of_a_point_are_those_of_its_beam() {
        for model in Model::ALL {
            if model == Model::Hdl64e {
                continue;
            }
            let rings = model.rings();
            for (laser, ring) in model.lasers().iter().zip(&rings) {
                let elevation = laser.elevation_deg.to_radians() as f32;
                let (sin, cos) = elevation.sin_cos();
                // 30 degrees to the right.
                let point = CloudPoint { x: 8.660_254 * cos, y: -5.0 * cos, z: 10.0 * sin, intensity: 0.5 };
                let [found] = returns_from_cloud(&[point], &model.into()).try_into().expect("one");
                assert_eq!((found.ring, found.azimuth, found.intensity), (*ring, 3000, 128));
            }
        }
    }

    #[test]
    fn invalid_points_are_removed() {
        let far = CloudPoint { x: -5.0, intensity: 200.0, ..CloudPoint::default() };
        let bad = CloudPoint { z: f32::NAN, ..far };
        let found = returns_from_cloud(&[CloudPoint::default(), bad, far], &Model::Hdl64e.into());
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].intensity, found[0].azimuth), (200, 18_000));
    }
}
