//! What the manifest of a live recording says of the sensors beside the LiDARs.

use drive::manifest::{CameraEntry, GnssEntry, ImuEntry, MosaicEntry};

/// Entries of the manifest for the sensors beside the LiDARs.
#[derive(Clone, Debug, Default)]
pub struct RecordedEntries {
    /// Color cameras.
    pub cameras: Vec<CameraEntry>,
    /// Mosaic cameras.
    pub mosaics: Vec<MosaicEntry>,
    /// GNSS receiver.
    pub gnss: Option<GnssEntry>,
    /// IMU.
    pub imu: Option<ImuEntry>,
}
