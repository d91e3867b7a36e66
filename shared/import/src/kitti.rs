//! KITTI raw and KITTI odometry (Geiger et al., IJRR 2013), with the labels of SemanticKITTI (Behley et al., ICCV 2019).

mod calibration;
mod labels;
pub(crate) mod odometry;
mod oxts;
pub(crate) mod raw;
mod sweeps;
mod unit_log;

/// Numbers of the cameras: the color cameras, otherwise the gray ones. Gray images in addition to color ones would gray
/// the points.
const CAMERA_CHOICES: [[usize; 2]; 2] = [[2, 3], [0, 1]];
/// Exposure of the cameras, ns: the data sets do not record it; 2 ms is the longest (IJRR 2013, section II).
const EXPOSURE_NANOS: u64 = 2_000_000;
