//! Entries of a live recording's manifest for the auxiliary sensors.

use drive::manifest::{CameraEntry, GnssEntry, ImuEntry, MosaicEntry};

/// Entries of the manifest for the auxiliary sensors.
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
