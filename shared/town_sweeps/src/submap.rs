//! Submaps with ground truth.

use crate::source::Return;
use geometry::{Point3, Pose, Vector3};
use messages::{SubmapHeader, SubmapPoint};
use random::Random;

/// Noise of the ranges, m: one sigma of the data sheets.
const RANGE_SIGMA_M: f32 = 0.02;

/// A submap with the class of every point.
pub struct TownSubmap {
    /// Header as from `slam_aggregate`, with true poses.
    pub header: Box<SubmapHeader>,
    /// Points in the body frame at the first firing.
    pub points: Vec<SubmapPoint>,
    /// True class id of each point.
    pub truth: Vec<u8>,
}

impl TownSubmap {
    /// Appends the returns of one turn. `submap_from_lidar` takes the time since its start, ns.
    pub(crate) fn push_turn(
        &mut self,
        returns: &[Return],
        sweep: usize,
        random: &mut Random,
        submap_from_lidar: impl Fn(i64) -> Pose,
    ) {
        for shot in returns.chunk_by(|a, b| a.nanos == b.nanos) {
            let submap_from_lidar = submap_from_lidar(shot[0].nanos);
            for found in shot {
                let azimuth = found.azimuth_deg.to_radians();
                let up = found.elevation_deg.to_radians();
                let range_m = f64::from(found.range_m + RANGE_SIGMA_M * random.gauss());
                let ray = Vector3::new(up.cos() * azimuth.cos(), -up.cos() * azimuth.sin(), up.sin());
                let at = submap_from_lidar * Point3::from(ray * range_m);
                self.points.push(SubmapPoint {
                    x: at.x as f32,
                    y: at.y as f32,
                    z: at.z as f32,
                    offset_nanos: found.nanos as u32,
                    azimuth: ((found.azimuth_deg * 100.0) as u16).min(35_999),
                    elevation: (found.elevation_deg * 100.0).round() as i16,
                    sweep_idx: sweep as u16,
                    intensity: found.intensity,
                    ring: found.ring,
                    ..SubmapPoint::default()
                });
                self.truth.push(found.class as u8);
            }
        }
    }
}
