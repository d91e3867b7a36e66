//! Points of clouds as returns of a LiDAR.

use formats::cloud::{CloudPoint, FiredPoint};
use lidar::{Lidar, Model, SweepPoint, velodyne};

/// Shortest range of a return: some files store missing returns as 0 0 0.
const MIN_RANGE_M: f32 = 0.1;

/// Returns in the order of the file, without times. Points that are not finite or closer than 0.1 m are removed. The azimuth is the
/// direction of the point. The ring is the nearest beam by elevation (for the HDL-64E: the beams of the KITTI device); 0 for
/// sensors without fixed beams. Intensities from 0 to 1 are scaled to 0 to 255.
pub fn returns_from_cloud(points: &[CloudPoint], lidar: &Lidar) -> Vec<SweepPoint> {
    let rings = Rings::new(lidar);
    let is_fraction = points.iter().all(|point| point.intensity <= 1.0);
    let scale = if is_fraction { 255.0 } else { 1.0 };
    returns(points, scale, |p| FiredPoint { point: *p, ..FiredPoint::default() }, |p| rings.nearest(p))
}

/// Whether a point of a cloud file is a return; others are left out of the sweep, and have no label in a drive.
pub fn is_return(p: &CloudPoint) -> bool {
    let range_m = (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
    range_m.is_finite() && range_m > MIN_RANGE_M
}

/// Returns as from [`returns_from_cloud`]. `scale`: factor of the intensities. `fired` gives the point with its time and `ring`
/// the ring of a row.
pub(super) fn returns<T>(
    rows: &[T],
    scale: f32,
    fired: impl Fn(&T) -> FiredPoint,
    ring: impl Fn(&T) -> u8,
) -> Vec<SweepPoint> {
    let one = |row: &T| {
        let FiredPoint { point: p, offset_nanos, .. } = fired(row);
        SweepPoint {
            x: p.x,
            y: p.y,
            z: p.z,
            offset_nanos,
            // Clockwise in 0.01 deg.
            azimuth: ((-p.y.atan2(p.x).to_degrees() * 100.0).round() as i32).rem_euclid(36_000) as u16,
            intensity: (p.intensity * scale).round().clamp(0.0, 255.0) as u8,
            ring: ring(row),
        }
    };
    rows.iter().filter(|row| is_return(&fired(row).point)).map(one).collect()
}

/// Elevations of the lower 32 beams of the HDL-64E of KITTI, lowest first, deg: medians over sweeps of its raw recordings, whose
/// points are ordered by beam. The elevation of a beam varies by less than 0.03 deg over a revolution.
#[rustfmt::skip]
const KITTI_LOWER_DEG: [f32; 32] = [
    -24.99, -24.49, -23.95, -23.3, -22.83, -22.41, -21.91, -21.29, -20.75, -20.19, -19.7,
    -19.28, -18.76, -18.28, -17.69, -17.14, -16.5, -16.13, -15.61, -15.14, -14.54, -13.99,
    -13.43, -12.99, -12.51, -12.06, -11.54, -10.9, -10.41, -10.0, -9.51, -8.96,
];
/// Elevations of the upper 32 beams, see [`KITTI_LOWER_DEG`].
#[rustfmt::skip]
const KITTI_UPPER_DEG: [f32; 32] = [
    -8.72, -8.32, -8.07, -7.69, -7.29, -7.0, -6.68, -6.33, -5.96, -5.61, -5.25,
    -4.91, -4.58, -4.21, -3.93, -3.53, -3.22, -2.86, -2.53, -2.19, -1.81, -1.47,
    -1.18, -0.78, -0.43, -0.06, 0.21, 0.61, 0.9, 1.34, 1.61, 1.98,
];
/// Height of the lower lasers above the origin of the points, m. At 5 m range this is two degrees.
const KITTI_LOWER_UP_M: f32 = 0.115;
/// Height of the upper lasers above the origin of the points, m.
const KITTI_UPPER_UP_M: f32 = 0.2;

/// Beams of one height, sorted by elevation.
struct Bank {
    up_m: f32,
    elevations: Vec<f32>,
}

/// All beams of a model, the highest bank first.
pub(super) struct Rings(Vec<Bank>);

impl Rings {
    pub(super) fn new(lidar: &Lidar) -> Self {
        let bank = |up_m: f32, degrees: &[f32]| {
            let mut elevations: Vec<f32> = degrees.iter().map(|degrees| degrees.to_radians()).collect();
            elevations.sort_by(f32::total_cmp);
            Bank { up_m, elevations }
        };
        if lidar.model() == Model::Velodyne(velodyne::Model::Hdl64e) {
            return Self(vec![bank(KITTI_UPPER_UP_M, &KITTI_UPPER_DEG), bank(KITTI_LOWER_UP_M, &KITTI_LOWER_DEG)]);
        }
        let degrees: Vec<f32> = lidar.elevations_deg().iter().map(|degrees| *degrees as f32).collect();
        // With fewer than two beams, points have no rings.
        Self(if degrees.len() < 2 { Vec::new() } else { vec![bank(0.0, &degrees)] })
    }

    pub(super) fn nearest(&self, p: &CloudPoint) -> u8 {
        let across_m = p.x.hypot(p.y);
        let mut n_below: usize = self.0.iter().map(|bank| bank.elevations.len()).sum();
        let mut ring = 0;
        for bank in &self.0 {
            n_below -= bank.elevations.len();
            let elevation = (p.z - bank.up_m).atan2(across_m);
            ring = n_below + bank.nearest(elevation);
            if bank.is_above_lower_end(elevation) {
                break;
            }
        }
        ring as u8
    }
}

impl Bank {
    /// Whether the elevation is above the lower end of the bank.
    fn is_above_lower_end(&self, elevation: f32) -> bool {
        let half_step = 0.5 * (self.elevations[1] - self.elevations[0]);
        elevation > self.elevations[0] - half_step
    }

    /// Index of the nearest beam.
    fn nearest(&self, elevation: f32) -> usize {
        let beams = &self.elevations;
        let above = beams.partition_point(|e| *e < elevation).clamp(1, beams.len() - 1);
        let lower_is_nearer = elevation - beams[above - 1] < beams[above] - elevation;
        if lower_is_nearer { above - 1 } else { above }
    }
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
