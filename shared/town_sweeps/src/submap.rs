//! Submaps with ground truth.

use formats::velodyne::Model;
use geometry::{Point3, Pose, Vector3};
use messages::{SubmapHeader, SubmapPoint};
use random::Random;
use simulation::sensors::lidar::{Block, Lidar};

/// Duration of a revolution, s.
pub(crate) const TURN_SECONDS: f64 = 0.1;
/// Noise of the ranges, m: one sigma of the data sheets.
const RANGE_SIGMA_M: f32 = 0.02;

/// A submap with the class of every point.
pub struct TownSubmap {
    /// As from `slam_aggregate`, with true poses.
    pub header: Box<SubmapHeader>,
    /// In the body frame at the first firing.
    pub points: Vec<SubmapPoint>,
    /// True class id of each point.
    pub truth: Vec<u8>,
}

impl TownSubmap {
    /// Appends the returns of one revolution. `submap_from_lidar` takes ns since its start.
    pub(crate) fn push_turn(
        &mut self,
        lidar: &Lidar<'_>,
        packets: std::ops::Range<u64>,
        sweep: usize,
        random: &mut Random,
        submap_from_lidar: impl Fn(i64) -> Pose,
    ) {
        let model = lidar.model().model;
        let rings = model.rings();
        for (packet, blocks) in (0..).zip(lidar.packets(packets)) {
            for (number, block) in blocks.iter().enumerate() {
                let block_nanos = model.firing_nanos(number, 0);
                let nanos = packet * i64::from(model.packet_nanos()) + i64::from(block_nanos);
                let submap_from_lidar = submap_from_lidar(nanos);
                for (index, found) in block.returns.iter().enumerate() {
                    let Some(found) = found else { continue };
                    let laser = laser_of(model, block, index);
                    let turned_nanos = model.firing_nanos(number, index) - block_nanos;
                    let carried = if model.carries_azimuth() { f64::from(turned_nanos) } else { 0.0 };
                    let turned_deg = carried * 1e-9 / TURN_SECONDS * 360.0;
                    let of_laser = &model.lasers()[laser];
                    let azimuth_deg =
                        (f64::from(block.azimuth) * 0.01 + turned_deg - of_laser.azimuth_deg).rem_euclid(360.0);
                    let (azimuth, up) = (azimuth_deg.to_radians(), of_laser.elevation_deg.to_radians());
                    let range_m = f64::from(found.range_m + RANGE_SIGMA_M * random.gauss());
                    let ray = Vector3::new(up.cos() * azimuth.cos(), -up.cos() * azimuth.sin(), up.sin());
                    let at = submap_from_lidar * Point3::from(ray * range_m);
                    self.points.push(SubmapPoint {
                        x: at.x as f32,
                        y: at.y as f32,
                        z: at.z as f32,
                        offset_nanos: nanos as u32,
                        azimuth: ((azimuth_deg * 100.0) as u16).min(35_999),
                        elevation: (of_laser.elevation_deg * 100.0).round() as i16,
                        sweep_idx: sweep as u16,
                        intensity: found.intensity,
                        ring: rings[laser],
                        ..SubmapPoint::default()
                    });
                    self.truth.push(found.class as u8);
                }
            }
        }
    }
}

/// The laser of a return.
fn laser_of(model: Model, block: &Block, index: usize) -> usize {
    index % model.n_rings() + if block.is_lower { 32 } else { 0 }
}
