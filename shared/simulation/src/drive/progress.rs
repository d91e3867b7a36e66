//! Progress of writing a drive, in measured work.

use crate::sensors::lidar::LidarModel;
use crate::simulation::Simulation;
use geometry::CameraModel;

/// Work of a lidar packet, in ms of one core.
pub const PACKET_WORK: f64 = 0.6;
/// Work of a pixel of a color image, in ms of one core.
const PIXEL_WORK: f64 = 3.2e-3;
/// Work of a mosaic image, in ms of one core.
pub const MOSAIC_WORK: f64 = 1000.0;

/// Work of a color image, in ms of one core.
pub fn image_work(lens: &CameraModel) -> f64 {
    let (width, height) = lens.size();
    f64::from(width) * f64::from(height) * PIXEL_WORK
}

/// Adds up finished work and reports its share of the whole.
pub struct Progress<'a> {
    done: f64,
    total: f64,
    report: &'a mut dyn FnMut(f64),
}

impl<'a> Progress<'a> {
    /// Starts at zero. `report` receives the finished share, 0 to 1.
    pub fn new(simulation: &Simulation, n_exposures: usize, report: &'a mut dyn FnMut(f64)) -> Self {
        let Simulation { spec, rig, .. } = simulation;
        let models = std::iter::once(rig.lidar.model).chain(rig.other_lidars.iter().map(|other| other.lidar.model));
        let n_packets: u64 = models.map(|model| LidarModel::for_model(model).n_packets(spec.seconds)).sum();
        let packets = n_packets as f64 * PACKET_WORK;
        let images: f64 = rig.cameras.iter().map(|camera| image_work(&camera.lens)).sum();
        let mosaics = rig.mosaics.len() as f64 * MOSAIC_WORK;
        let exposure = if spec.cameras { images } else { 0.0 } + if spec.mosaics { mosaics } else { 0.0 };
        Self { done: 0.0, total: packets + n_exposures as f64 * exposure, report }
    }
    /// Adds finished work, in ms of one core.
    pub fn add(&mut self, work: f64) {
        self.done += work;
        (self.report)((self.done / self.total).min(1.0));
    }
}
