//! Sweeps stored as one cloud file each.

use formats::cloud::{CloudPoint, FiredPoint};
use formats::{kitti, nuscenes, pcd};
use lidar::{Lidar, Model, SweepPoint, SweepReader, velodyne};
use std::io;
use std::path::Path;

/// Shortest range of a return: some files store missing returns as 0 0 0.
const MIN_RANGE_M: f32 = 0.1;

/// Error of a cloud file that cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum CloudFault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Kitti(#[from] kitti::KittiError),
    #[error(transparent)]
    Nuscenes(#[from] nuscenes::NuscenesError),
    #[error(transparent)]
    Pcd(#[from] pcd::PcdError),
    #[error("{found} points; a sweep has at most {limit}")]
    TooManyPoints { found: usize, limit: usize },
    #[error("ring {ring}: a {model} has {n_rings} rings, counted from 0; set lidar.model")]
    Ring { ring: u8, n_rings: usize, model: &'static str },
    #[error(
        "points reach {found_nanos} ns after the sweep's stamp, the next sweep begins after {next_nanos} ns; times must begin at the stamp"
    )]
    Late { found_nanos: u32, next_nanos: u32 },
}

/// The returns of a cloud file.
#[derive(Debug)]
pub(super) struct CloudReturns {
    /// The returns, sorted by time if they have times, otherwise in the order of the file.
    pub(super) returns: Vec<SweepPoint>,
    pub(super) has_times: bool,
}

/// The returns of a cloud file.
pub(super) fn load(path: &Path, format: &str, lidar: &Lidar) -> Result<CloudReturns, CloudFault> {
    let bytes = std::fs::read(path)?;
    let untimed = |returns| CloudReturns { returns, has_times: false };
    let found = match format {
        "bin" => untimed(returns_from_cloud(&kitti::points_from_bin(&bytes)?, lidar)),
        "nuscenes" => {
            let rows = nuscenes::points_from_bin(&bytes)?;
            untimed(returns(
                &rows,
                |(point, _)| FiredPoint { point: *point, ..FiredPoint::default() },
                |(_, ring)| *ring,
            ))
        }
        _ => returns_from_pcd(&pcd::cloud_from_pcd(&bytes)?, lidar)?,
    };
    let limit = SweepReader::MAX_RETURNS;
    if found.returns.len() > limit {
        return Err(CloudFault::TooManyPoints { found: found.returns.len(), limit });
    }
    Ok(found)
}

/// Returns as from [`returns_from_cloud`], with the rings and times of the file.
fn returns_from_pcd(cloud: &pcd::PcdCloud, lidar: &Lidar) -> Result<CloudReturns, CloudFault> {
    let n_rings = lidar.n_rings();
    let beyond = |p: &&FiredPoint| cloud.has_rings && n_rings > 0 && usize::from(p.ring) >= n_rings;
    if let Some(FiredPoint { ring, .. }) = cloud.points.iter().find(beyond) {
        return Err(CloudFault::Ring { ring: *ring, n_rings, model: lidar.model().name() });
    }
    let rings = Rings::new(lidar);
    let ring = |p: &FiredPoint| if cloud.has_rings { p.ring } else { rings.nearest(&p.point) };
    let mut returns = returns(&cloud.points, |p| *p, ring);
    if !returns.is_sorted_by_key(|found| found.offset_nanos) {
        returns.sort_by_key(|found| found.offset_nanos);
    }
    Ok(CloudReturns { returns, has_times: cloud.has_times })
}

/// Returns in the order of the file, without times. Points that are not finite or closer than 0.1 m are removed. The azimuth is the
/// direction of the point. The ring is the nearest beam by elevation (for the HDL-64E: the beams of the KITTI device); 0 for
/// sensors without fixed beams. Intensities from 0 to 1 are scaled to 0 to 255.
pub fn returns_from_cloud(points: &[CloudPoint], lidar: &Lidar) -> Vec<SweepPoint> {
    let rings = Rings::new(lidar);
    returns(points, |p| FiredPoint { point: *p, ..FiredPoint::default() }, |p| rings.nearest(p))
}

/// Whether a point of a cloud file is a return; others are left out of the sweep, and have no label in a drive.
pub fn is_return(p: &CloudPoint) -> bool {
    let range_m = (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
    range_m.is_finite() && range_m > MIN_RANGE_M
}

/// Returns as from [`returns_from_cloud`]. `fired` gives the point with its time and `ring` the ring of a row.
fn returns<T>(rows: &[T], fired: impl Fn(&T) -> FiredPoint, ring: impl Fn(&T) -> u8) -> Vec<SweepPoint> {
    let is_fraction = rows.iter().all(|row| fired(row).point.intensity <= 1.0);
    let scale = if is_fraction { 255.0 } else { 1.0 };
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
struct Rings(Vec<Bank>);

impl Rings {
    fn new(lidar: &Lidar) -> Self {
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

    fn nearest(&self, p: &CloudPoint) -> u8 {
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

    /// Points of a raw sweep are ordered by beam, from the highest to the lowest. A jump of the azimuth marks the next beam.
    #[real_data::test("kitti_raw_0048/0000000003.pcd")]
    fn rings_of_real_sweep_match_the_order_of_its_points() {
        let path = real_data::path("kitti_raw_0048/0000000003.pcd");
        let returns = load(&path, "pcd", &Model::Hdl64e.into()).expect("reads").returns;
        let mut ring = 63_u8;
        let mut n_right = 0;
        let mut last = 0.0_f32;
        for found in &returns {
            let angle = found.y.atan2(found.x);
            if last < 0.0 && angle >= 0.0 && angle - last < 1.0 {
                ring = ring.saturating_sub(1);
            }
            last = angle;
            n_right += usize::from(found.ring == ring);
        }
        assert_eq!(ring, 0);
        assert!(n_right * 1000 > returns.len() * 998, "{n_right} of {}", returns.len());
    }

    #[test]
    fn returns_with_times_are_in_firing_order_and_keep_their_rings() {
        let point = CloudPoint { x: 5.0, intensity: 9.0, ..CloudPoint::default() };
        let fired = |(ring, offset_nanos)| FiredPoint { point, ring, offset_nanos };
        let points = [(0, 50_000), (15, 0), (1, 50_000), (0, 99_000_000)].map(fired).to_vec();
        let mut cloud = pcd::PcdCloud { points, has_rings: true, has_times: true };
        let found = returns_from_pcd(&cloud, &Model::Vlp16.into()).expect("valid");
        let order: Vec<(u8, u32)> = found.returns.iter().map(|found| (found.ring, found.offset_nanos)).collect();
        assert!(found.has_times && order == [(15, 0), (0, 50_000), (1, 50_000), (0, 99_000_000)], "{order:?}");
        cloud.points[2].ring = 16;
        let error = returns_from_pcd(&cloud, &Model::Vlp16.into()).expect_err("is beyond").to_string();
        assert!(error.starts_with("ring 16: a vlp16 has 16 rings"), "{error}");
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
