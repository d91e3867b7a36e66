//! KITTI raw and KITTI odometry (Geiger et al., IJRR 2013), with the labels of SemanticKITTI (Behley et al., ICCV 2019).

mod calibration;
mod labels;
pub(crate) mod odometry;
mod oxts;
pub(crate) mod raw;
mod sweeps;
mod unit_log;

/// Cameras by number: those of color, else those of gray. Gray images beside color ones would gray the points.
const CAMERA_CHOICES: [[usize; 2]; 2] = [[2, 3], [0, 1]];
/// Exposure of the cameras, ns: the data sets do not record it; 2 ms is their longest (IJRR 2013, section II).
const EXPOSURE_NANOS: u64 = 2_000_000;
